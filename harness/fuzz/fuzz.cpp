#include "harness/fuzz/fuzz.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <memory>
#include <thread>

#include "accel/contract/valid_ray.h"
#include "accel/host/parameters.h"
#include "harness/fuzz/isolate.h"
#include "harness/fuzz/shrink.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/progress.h"

namespace raybench::fuzz {
namespace {

constexpr double kHang = 20;
/// A child makes way for a new one after so many cases: what a case leaves behind harms few others.
constexpr uint64_t kCasesOfChild = 400;
constexpr double kShrinkSeconds = 20, kShrinkHang = 5;
/// Kinds of findings of a structure that are shrunk; the others are told.
constexpr size_t kShrunkKinds = 4;

/// A stage in words that a child can send: check, tab, text, newline.
std::string Line(uint64_t index, const Finding& finding) {
  std::string text = finding.text;
  std::replace(text.begin(), text.end(), '\n', ' ');
  return fmt::format("{}\t{}\t{}\n", index, finding.check, text);
}

struct Message {
  uint64_t index;
  Finding finding;
};
/// Takes whole lines from the front of `text`.
std::vector<Message> TakeLines(std::string& text) {
  std::vector<Message> messages;
  size_t begin = 0;
  for (size_t end; (end = text.find('\n', begin)) != text.npos; begin = end + 1) {
    const std::string line = text.substr(begin, end - begin);
    const size_t first = line.find('\t'), second = line.find('\t', first + 1);
    if (second == line.npos) continue;
    messages.push_back(
        {std::stoull(line), {line.substr(first + 1, second - first - 1), line.substr(second + 1)}});
  }
  text.erase(0, begin);
  return messages;
}

Finding Ended(const char* check, const std::string& how) {
  return {check, fmt::format("the process {}", how)};
}

class Campaign {
 public:
  Campaign(const Registry& registry, const FuzzOptions& options)
      : registry_(registry),
        options_(options),
        mode_(options.mode == "exact"     ? Mode::kExact
              : options.mode == "chaotic" ? Mode::kChaotic
                                          : Mode::kBoth) {
    if (options.structures.empty() || options.structures == std::vector<std::string>{"all"}) {
      for (const rb_structure* s : registry.structures()) specs_.push_back(s->name);
    } else {
      specs_ = options.structures;
      for (const std::string& spec : specs_) ParseContestant(registry, spec);
    }
    jobs_ = options.jobs != 0 ? options.jobs : AllThreads();
    standard_ = options.scenes ? StandardCaseCount() : 0;
    counts_ = std::make_unique<Shared<Count>>(specs_.size());
    looked_at_ = std::make_unique<Shared<std::atomic<uint64_t>>>(specs_.size() * Checks().size());
    stages_ = std::make_unique<Shared<Stage>>(jobs_);
    next_ = std::make_unique<Shared<std::atomic<uint64_t>>>(1);
    stop_ = std::make_unique<Shared<std::atomic<bool>>>(1);
  }

  FuzzResult Go() {
    start_ = SecondsNow();
    {
      Progress progress;
      std::vector<Worker> workers(jobs_);
      for (size_t i = 0; i < jobs_; ++i) Start(workers[i], i);
      while (!workers.empty()) {
        Wait(workers);
        if (Enough()) (*stop_)[0] = true;
        for (size_t i = 0; i < workers.size();) {
          if (Serve(workers[i])) {
            ++i;
          } else {
            workers.erase(workers.begin() + ptrdiff_t(i));
          }
        }
        if (!options_.quiet) Tell(progress);
      }
      result_.seconds = SecondsNow() - start_;
      ShrinkAll(progress);
    }
    for (size_t i = 0; i < specs_.size(); ++i) {
      const Count& c = (*counts_)[i];
      FuzzedStructure& s =
          result_.structures.emplace_back(FuzzedStructure{specs_[i], c.cases, c.left_out, c.rays, {}});
      for (size_t k = 0; k < Checks().size(); ++k) s.looked_at.push_back(LookedAt(i, k));
    }
    result_.interrupted = Interrupted();
    return std::move(result_);
  }

  /// Case `index`, with its structure.
  Case CaseOf(uint64_t index) const {
    const uint64_t round = index / specs_.size();
    const std::string& spec = specs_[index % specs_.size()];
    Random random(options_.seed, ~index);
    const bool standard = round % 2 == 0 && round / 2 < standard_;  // they take turns with random ones
    Case c = standard ? StandardCase(round / 2, options_.seed) : GenerateCase(mode_, options_.seed, index);
    c.structure = spec;
    if (!standard && spec.find('(') == spec.npos && random.Below(2))
      c.structure = DrawParameters(registry_.Find(spec), random);
    c.seed = 1 + random.Below(1u << 16);
    c.check = options_.check;
    return c;
  }

 private:
  struct Count {
    std::atomic<uint64_t> cases{0}, left_out{0}, rays{0};
  };
  struct Worker {
    size_t slot = 0;
    std::unique_ptr<Child> child;
    std::string text;
  };

  std::atomic<uint64_t>& LookedAt(size_t structure, size_t check) const {
    return (*looked_at_)[structure * Checks().size() + check];
  }
  Stage& StageOf(size_t slot) { return (*stages_)[slot]; }
  uint64_t CasesSoFar() const {
    uint64_t n = 0;
    for (size_t i = 0; i < specs_.size(); ++i) n += (*counts_)[i].cases;
    return n;
  }
  bool IsTimeUp() const { return options_.seconds > 0 && SecondsNow() - start_ >= options_.seconds; }
  bool Enough() const {
    return Interrupted() || IsTimeUp() ||
           (options_.findings != 0 && result_.faults.size() >= options_.findings);
  }
  bool IsLast(uint64_t index) const { return options_.cases != 0 && index >= options_.cases; }

  void Start(Worker& worker, size_t slot) {
    worker.slot = slot;
    worker.text.clear();
    StageOf(slot).since = SecondsNow(), StageOf(slot).processor = 0;
    worker.child =
        std::make_unique<Child>(Limits{kHang, 2048, true}, [this, slot](int out) { Work(slot, out); });
  }

  /// In the child: cases until there are no more.
  void Work(size_t slot, int out) {
    Stage& stage = StageOf(slot);
    for (uint64_t n = 0; n < kCasesOfChild && !(*stop_)[0]; ++n) {
      const uint64_t index = (*next_)[0].fetch_add(1);
      if (IsLast(index)) return;
      stage.index = index, stage.since = SecondsNow(), stage.processor = ProcessorSeconds();
      stage.check = "generating";
      const Case c = CaseOf(index);
      Count& count = (*counts_)[index % specs_.size()];
      const Examination e = Examine(registry_, c, [&](const char* check) { stage.check = check; });
      stage.check = "";
      ++count.cases;
      for (size_t k = 0; k < Checks().size(); ++k)
        LookedAt(index % specs_.size(), k) +=
            std::count(e.looked_at.begin(), e.looked_at.end(), std::string_view(Checks()[k].name)) > 0;
      count.left_out += !e.left_out.empty();
      count.rays += e.left_out.empty() ? c.rays.size() : 0;
      for (const Finding& finding : e.findings) {
        const std::string line = Line(index, finding);
        if (write(out, line.data(), line.size()) < 0) return;
      }
    }
  }

  void Wait(std::vector<Worker>& workers) {
    std::vector<pollfd> waiting;
    for (const Worker& worker : workers) waiting.push_back({worker.child->out(), POLLIN, 0});
    poll(waiting.data(), waiting.size(), 100);
  }

  /// False when the worker has nothing more to do.
  bool Serve(Worker& worker) {
    Stage& stage = StageOf(worker.slot);
    const bool open = worker.child->Read(worker.text);
    for (const Message& message : TakeLines(worker.text)) Note(message.index, message.finding);
    if (open) {
      const bool hangs =
          IsHung(SecondsNow() - stage.since, worker.child->ProcessorSeconds() - stage.processor, kHang);
      if (hangs) Note(stage.index, Ended(stage.check, fmt::format("does not end within {} s", kHang)));
      // A case in work when the time is up is given a moment.
      if (!hangs && !((*stop_)[0] && SecondsNow() - stage.since > 1)) return true;
      worker.child->Kill();
    }
    const std::string how = worker.child->Wait();
    if (!open && !how.empty()) {
      Note(stage.index, Ended(stage.check, how));
      ++(*counts_)[stage.index % specs_.size()].cases;
    }
    if ((*stop_)[0] || IsLast((*next_)[0])) return false;
    Start(worker, worker.slot);
    return true;
  }

  void Note(uint64_t index, const Finding& finding) {
    const std::string& spec = specs_[index % specs_.size()];
    const auto key = std::pair(spec, finding.check);
    if (!known_.insert(key).second) return;
    FoundFault fault;
    fault.structure = spec, fault.check = finding.check, fault.text = finding.text;
    fault.index = index, fault.seconds = SecondsNow() - start_, fault.cases = CasesSoFar();
    fault.smallest = CaseInParent(index);
    fault.smallest.check = fault.check;
    fault.primitives_before = fault.smallest.primitives(), fault.rays_before = fault.smallest.rays.size();
    if (options_.on_found) options_.on_found(fault);
    result_.faults.push_back(std::move(fault));
  }

  void Tell(Progress& progress) const {
    const std::string what =
        fmt::format("fuzzing: {} cases, {} broken promises", CasesSoFar(), result_.faults.size());
    if (options_.cases != 0 && options_.seconds == 0) {
      progress.Update(double(CasesSoFar()) / double(options_.cases), what);
    } else {
      progress.UpdateLeft(std::max(0.0, options_.seconds - (SecondsNow() - start_)), what);
    }
  }

  // ---- afterwards ----

  /// What is made by threads is made in a child: who has threads cannot fork.
  Case CaseInParent(uint64_t index) const {
    std::string text;
    RunIsolated(
        {kHang, 2048, true}, [&] { return Format(CaseOf(index)); }, text);
    return ParseCase(text, "case");
  }

  void ShrinkAll(Progress& progress) {
    const auto rank = [](const std::string& check) {
      size_t i = 0;
      for (const CheckInfo& info : Checks()) {
        if (check == info.name) break;
        ++i;
      }
      return i;
    };
    std::stable_sort(result_.faults.begin(), result_.faults.end(),
                     [&](const FoundFault& a, const FoundFault& b) {
                       return std::pair(a.structure, rank(a.check)) < std::pair(b.structure, rank(b.check));
                     });
    std::map<std::string, size_t> shrunk;
    for (FoundFault& fault : result_.faults) {
      if (shrunk[fault.structure]++ >= kShrunkKinds || Interrupted()) continue;
      if (!options_.quiet)
        progress.UpdateLeft(kShrinkSeconds, fmt::format("shrinking {}: {}", fault.structure, fault.check));
      ShrinkFault(registry_, fault, options_.shrink);
    }
  }

  const Registry& registry_;
  const FuzzOptions& options_;
  const Mode mode_;
  std::vector<std::string> specs_;
  size_t jobs_ = 1;
  double start_ = 0;
  size_t standard_ = 0;
  std::unique_ptr<Shared<Count>> counts_;
  std::unique_ptr<Shared<std::atomic<uint64_t>>> looked_at_;
  std::unique_ptr<Shared<Stage>> stages_;
  std::unique_ptr<Shared<std::atomic<uint64_t>>> next_;
  std::unique_ptr<Shared<std::atomic<bool>>> stop_;
  std::set<std::pair<std::string, std::string>> known_;
  FuzzResult result_;
};

}  // namespace

void ShrinkFault(const Registry& registry, FoundFault& fault, bool shrink) {
  // Alone in a new process it may be another matter; what depends on chance gets a few tries.
  std::string text;
  const auto fails = [&](const Case& c) {
    if (!std::all_of(c.rays.begin(), c.rays.end(), IsValidRay)) return false;
    for (const Finding& f : ExamineIsolated(registry, c, kShrinkHang))
      if (f.check == fault.check) return text = f.text, true;
    return false;
  };
  for (int tries = 0; tries < 20 && !fault.repeats; ++tries) fault.repeats = fails(fault.smallest);
  if (!fault.repeats) return;
  fault.text = text;
  if (!shrink) return;
  const double end = SecondsNow() + kShrinkSeconds;
  Shrunk shrunk = Shrink(fault.smallest, fails, [end] { return SecondsNow() > end || Interrupted(); });
  fault.smallest = std::move(shrunk.smallest), fault.tries = shrunk.tries;
  if (fails(fault.smallest)) fault.text = text;
}

FuzzResult Fuzz(const Registry& registry, const FuzzOptions& options) {
  return Campaign(registry, options).Go();
}

std::vector<Finding> ExamineIsolated(const Registry& registry, const Case& c, double seconds,
                                     std::string* left_out) {
  Shared<Stage> stage(1);
  stage[0].check = "builds";
  std::string output;
  const std::string how = RunIsolated(
      {seconds, 2048, true},
      [&] {
        std::string text;
        try {
          const Examination e = Examine(registry, c, [&](const char* check) { stage[0].check = check; });
          for (const Finding& finding : e.findings) text += Line(0, finding);
          if (!e.left_out.empty()) text += Line(1, {"", e.left_out});
        } catch (const InputError& error) {
          text += Line(1, {"", error.what()});
        }
        return text;
      },
      output);
  std::vector<Finding> findings;
  for (Message& message : TakeLines(output)) {
    if (message.index == 0) {
      findings.push_back(std::move(message.finding));
    } else if (left_out != nullptr) {
      *left_out = message.finding.text;
    }
  }
  if (!how.empty()) findings.push_back(Ended(stage[0].check, how));
  return findings;
}

}  // namespace raybench::fuzz
