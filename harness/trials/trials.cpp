#include "harness/trials/trials.h"

#include <fmt/format.h>
#include <malloc.h>

#include <atomic>
#include <chrono>
#include <ctime>
#include <iostream>
#include <numeric>
#include <thread>

#include "datasets/scene/needs.h"
#include "harness/judge/claim.h"
#include "harness/judge/truth_cache.h"
#include "harness/measure/machine.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/rays/from_inside.h"
#include "harness/terminal/interrupt.h"

namespace raybench {
namespace {

double Seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// A flag for rb_build_options.cancel that is set when this process has used up its processor time, or after
/// a Ctrl-C.
class TimeLimit {
 public:
  explicit TimeLimit(double seconds)
      : end_(Seconds(CLOCK_PROCESS_CPUTIME_ID) + seconds), watch_([this] { Watch(); }) {}
  ~TimeLimit() {
    done_ = true;
    watch_.join();
  }
  const volatile int* flag() const { return &flag_; }

 private:
  void Watch() {
    while (!done_) {
      std::this_thread::sleep_for(std::chrono::microseconds(500));
      if (Seconds(CLOCK_PROCESS_CPUTIME_ID) > end_ || Interrupted()) flag_ = 1;
    }
  }

  volatile int flag_ = 0;
  std::atomic<bool> done_ = false;
  const double end_;
  std::thread watch_;  // last: starts when all else is there
};

uint64_t BytesOf(const Tree& tree, const rb_geometry& geometry) {
  uint64_t nodes = 0, prims = 0;
  int needs_geometry = 0;
  tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
  const uint64_t mesh =
      geometry.vertex_count * sizeof(float[3]) + geometry.triangle_count * sizeof(uint32_t[3]);
  return nodes + prims + (needs_geometry != 0 ? mesh : 0);
}

bool AsksAny(const std::vector<MixedSet>& mix) {
  return std::any_of(mix.begin(), mix.end(), [](const MixedSet& set) { return set.query == RB_ANY; });
}

}  // namespace

Trials::Trials(const Registry& registry, const Scene& scene, const MixOptions& options)
    : registry_(registry),
      scene_(scene),
      seed_(options.seed),
      needs_(NeedsOf(scene).BuildNeeds()),
      memory_limit_(UsableMemory() / 2),
      mix_(CaptureMix(registry, scene, options)),
      random_(options.seed) {
  // Big blocks come from fresh pages in every build, as in a process that builds once.
  mallopt(M_MMAP_THRESHOLD, 1 << 17);
  mallopt(M_TRIM_THRESHOLD, 1 << 17);
}

Json Trials::Facts() const {
  Json sets = Json::array();
  for (const MixedSet& set : mix_)
    sets.push_back({{"set", set.label},
                    {"query", QueryName(set.query)},
                    {"share", set.share},
                    {"training", set.Count(false)},
                    {"held_out", set.Count(true)}});
  return {{"scene", scene_.name},
          {"hash", scene_.hash()},
          {"primitives", scene_.primitive_count()},
          {"procedural", scene_.procedural_count()},
          {"memory_limit", memory_limit_},
          {"sets", sets}};
}

Json Trials::Answer(const Json& request) {
  try {
    if (request.contains("build")) return Build(request.at("build"), request.value("seconds", 1e9));
    if (request.contains("time")) return Time(request.at("time").get<std::vector<uint64_t>>(), request);
    if (request.contains("judge")) return Judge(request.at("judge"), request.value("rays", uint64_t{4096}));
    if (!request.contains("drop")) throw InputError("a request has one of the keys build, time, judge, drop");
    for (const uint64_t tree : request.at("drop").get<std::vector<uint64_t>>()) trees_.erase(tree);
    return Json::object();
  } catch (const Json::exception& error) {
    return {{"error", error.what()}};
  } catch (const InputError& error) {
    return {{"error", error.what()}};
  }
}

Json Trials::Build(const std::string& spec, double limit) {
  const Contestant contestant = ParseContestant(registry_, spec);
  if (const std::string why = WhyNotTaken(*contestant.structure, scene_); !why.empty())
    return {{"stopped", why}, {"seconds", 0}};
  rb_build_options options = BuildOptions(1, seed_, AsksAny(mix_) ? needs_ | RB_NEED_ANY : needs_);
  options.memory_limit = memory_limit_;
  const TimeLimit stop(limit);
  options.cancel = stop.flag();
  const double start = Seconds(CLOCK_PROCESS_CPUTIME_ID);
  const auto spent = [&] { return Seconds(CLOCK_PROCESS_CPUTIME_ID) - start; };
  try {
    const rb_geometry geometry = scene_.Geometry();
    Tree tree(contestant, geometry, options);
    const double seconds = spent();
    const Json built = {{"tree", next_},
                        {"seconds", seconds},
                        {"bytes", BytesOf(tree, geometry)},
                        {"claims", ClaimName(tree.Claims())}};
    trees_.emplace(next_++, std::move(tree));
    return built;
  } catch (const BuildError& error) {
    ThrowIfInterrupted();
    const double seconds = spent();
    return {{"stopped", seconds > limit ? "takes too long to build" : error.what()}, {"seconds", seconds}};
  }
}

Trials::Asked Trials::Part(bool held_out, uint64_t rays) const {
  Asked asked;
  for (const MixedSet& set : mix_) {
    asked.rays.push_back(set.Rays(held_out, uint64_t(set.share * double(rays))));
    asked.most = std::max(asked.most, asked.rays.back().size());
  }
  return asked;
}

const Tree& Trials::Find(uint64_t tree) const {
  const auto it = trees_.find(tree);
  if (it == trees_.end()) throw InputError(fmt::format("there is no tree {}", tree));
  return it->second;
}

Json Trials::Time(const std::vector<uint64_t>& trees, const Json& request) {
  const Asked asked = Part(request.value("held_out", false), request.at("rays"));
  const uint64_t rounds = request.value("rounds", uint64_t{1});
  const double limit = request.value("seconds", 1e9), start = Seconds(CLOCK_THREAD_CPUTIME_ID);
  Answers answers(asked.most);
  const auto nanoseconds = [&](const Tree& tree, size_t set) {
    const std::vector<rb_ray>& rays = asked.rays[set];
    const rb_query query = answers.To({.query = mix_[set].query, .rays = rays});
    const double from = Seconds(CLOCK_THREAD_CPUTIME_ID);
    tree.Query(query);
    return 1e9 * (Seconds(CLOCK_THREAD_CPUTIME_ID) - from) / double(rays.size());
  };
  std::vector<size_t> order(trees.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::vector<std::vector<std::vector<double>>> ns(trees.size());
  for (uint64_t round = 0; round < rounds; ++round) {
    for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random_.Below(i)]);
    for (const size_t i : order) {
      ThrowIfInterrupted();
      std::vector<double>& of_sets = ns[i].emplace_back();
      for (size_t set = 0; set < mix_.size(); ++set) of_sets.push_back(nanoseconds(Find(trees[i]), set));
    }
    if (Seconds(CLOCK_THREAD_CPUTIME_ID) - start > limit) break;
  }
  return {{"ns", ns}};
}

void Trials::FindTruth(uint64_t rays) {
  if (judged_rays_ == rays) return;
  if (!oracle_) oracle_ = MakeOracle(scene_);
  judging_.clear();
  const Asked mix = Part(false, rays);
  for (size_t i = 0; i < mix_.size(); ++i) judging_.push_back({mix_[i].query, mix.rays[i], {}, false});
  if (!scene_.triangles.empty())
    judging_.push_back({RB_CLOSEST, AimedRays(scene_, rays, seed_).rays, {}, true});
  const TruthListener listener{.progress = [](double) { ThrowIfInterrupted(); },
                               .say = [](const std::string& line) { fmt::print(stderr, "{}\n", line); }};
  for (Judging& j : judging_) j.truth = CachedTruth(*oracle_, scene_, j.rays, 0, listener);
  judged_rays_ = rays;
}

Json Trials::Judge(uint64_t number, uint64_t rays) {
  const Tree& tree = Find(number);
  FindTruth(rays);
  const auto none = [] { return Json{{"rays", 0}, {"errors", 0}, {"t_error_max", 0.0}}; };
  Json judged = {{"mix", none()}, {"aimed", none()}, {"broken", ""}};
  for (const Judging& j : judging_) {
    Answers answers(j.rays.size());
    const Question question{.query = j.query, .rays = j.rays, .has_uv = (needs_ & RB_NEED_UV) != 0};
    const Verdicts verdicts =
        AskAndJudge(tree, *oracle_, scene_.primitive_count(), question, {j.truth}, answers, 0);
    const VerdictCounts& counts = verdicts.counts;
    std::string broken = verdicts.contract_flaw;
    if (broken.empty()) broken = BrokenClaim(tree.Claims(), counts, verdicts.breaking, scene_.scale_exponent);
    if (!broken.empty()) judged["broken"] = broken;
    Json& of = judged[j.aimed ? "aimed" : "mix"];
    of["rays"] = of["rays"].get<uint64_t>() + counts.rays;
    of["errors"] = of["errors"].get<uint64_t>() + counts.leaks() + counts.plain_errors();
    of["t_error_max"] = std::max(of["t_error_max"].get<double>(), counts.t_error_max);
  }
  return judged;
}

int ServeTrials(Trials& trials) {
  const auto say = [](const Json& json) {
    std::cout << json.dump(-1, ' ', false, Json::error_handler_t::replace) << std::endl;
  };
  say(trials.Facts());
  for (std::string line; std::getline(std::cin, line);) {
    const Json request = Json::parse(line, nullptr, false);
    say(request.is_object() ? trials.Answer(request)
                            : Json{{"error", "a request is one JSON object a line"}});
  }
  return 0;
}

}  // namespace raybench
