#include "harness/fuzz/examine.h"

#include <fmt/format.h>

#include <new>

#include "accel/host/names.h"
#include "harness/fuzz/examiner.h"
#include "harness/plan/plan.h"

namespace raybench::fuzz {
namespace {

/// What may be taken by a tree whose parameters were drawn at random.
constexpr uint64_t kMemoryLimit = 32u << 20;

}  // namespace

Examination Examiner::Run(const std::function<void(const char*)>& on_check) {
  if (on_check) on_check("builds");
  result_.left_out = WhyNotTaken(*contestant_.structure, scene_);
  if (!result_.left_out.empty()) return std::move(result_);
  const bool by_default = case_.structure == contestant_.structure->name;
  try {
    tree_ = Build(contestant_, geometry_, {.memory_limit = by_default ? 0 : kMemoryLimit});
  } catch (const BuildError& error) {
    // Parameters may ask for more than there is, and are told so.
    if (!by_default) return result_.left_out = error.what(), std::move(result_);
    Found("builds", error.what());
    return std::move(result_);
  }
  result_.claim = tree_.Claims();
  result_.looked_at.push_back("builds");
  for (const auto& [info, check] : kTable) {
    if (!case_.check.empty() && case_.check != info.name) continue;
    if (!IsAskedOf(info.demand) || (info.capability != 0 && !Can(info.capability))) continue;
    if (on_check) on_check(info.name);
    result_.looked_at.push_back(info.name);
    if (auto text = (this->*check)()) Found(info.name, std::move(*text));
  }
  return std::move(result_);
}

std::span<const CheckInfo> Examiner::Infos() {
  static const auto infos = [] {
    std::vector<CheckInfo> all{
        {"builds", Demand::kAlways, "builds over valid input, at its default parameters"}};
    for (const Row& row : kTable) all.push_back(row.info);
    return all;
  }();
  return infos;
}

using enum Demand;
const Examiner::Row Examiner::kTable[] = {
    {{"contract", kAlways, "every answer is written and possible: t, primitive, occluded"},
     &Examiner::Contract},
    {{"tree", kAlways, "the nodes it shows hold every primitive, in bounds that enclose it"},
     &Examiner::TreeIsSound},
    {{"closest", kConservative, "closest hits as exact geometry allows by the claim"},
     &Examiner::ClosestIsTrue},
    {{"any", kConservative, "any-hit answers likewise"}, &Examiner::AnyIsTrue},
    {{"uv", kConservative, "u and v of the point that is hit"}, &Examiner::UvIsTrue},
    {{"ties", kConservative, "of several hits at one t the lowest primitive"}, &Examiner::LowestCopy},
    {{"lattice", kConservative, "all hits where integers leave no doubt"}, &Examiner::Lattice},
    {{"any_closest", kAlways, "any-hit says whether there is a closest hit"}, &Examiner::AnyIsClosest},
    {{"tfar", kConservative, "tfar at a hit keeps it, tfar before it does not"}, &Examiner::EndsAtHit},
    {{"tnear", kConservative, "tnear at a hit leads to the next one"}, &Examiner::BeginsAtHit},
    {{"skip", kAlways, "a skipped primitive is not hit, and nothing else is lost", RB_CAN_SKIP},
     &Examiner::Skip},
    {{"after", kAlways, "`after` walks all hits in order", RB_CAN_AFTER}, &Examiner::After},
    {{"batch", kAlways, "the same answers in batches of any size, and asked again"}, &Examiner::Batches},
    {{"counted", kAlways, "counting changes no answer, and counts the same each time", RB_CAN_COUNT},
     &Examiner::Counting},
    {{"threads", kAlways, "several threads may ask at once"}, &Examiner::Threads},
    {{"rebuilt", kAlways, "the same tree each time", RB_DETERMINISTIC}, &Examiner::SameTreeTwice},
    {{"build_threads", kAlways, "the same tree on any number of threads", RB_DETERMINISTIC},
     &Examiner::SameTreeOnThreads},
    {{"needs", kAlways, "the same hits where less is needed", RB_DETERMINISTIC}, &Examiner::FewerNeeds},
    {{"memory_limit", kAlways, "a tree within the memory limit, or none"}, &Examiner::KeepsMemoryLimit},
    {{"brute", kOwn, "the answers of brute force, to the bit"}, &Examiner::IsBrute},
    {{"scaled", kOwn, "scaling by a power of two changes no bit"}, &Examiner::Scaled},
    {{"turned", kOwn, "axes exchanged or mirrored change no bit of exact arithmetic"}, &Examiner::Turned},
    {{"renumbered", kOwn, "the order of primitives changes no t"}, &Examiner::Renumbered},
    {{"added", kOwn, "geometry that no ray meets changes no answer"}, &Examiner::Added},
};

std::span<const CheckInfo> Checks() { return Examiner::Infos(); }

const CheckInfo& FindCheck(std::string_view name) {
  std::vector<std::string_view> names;
  for (const CheckInfo& info : Checks()) {
    if (name == info.name) return info;
    names.push_back(info.name);
  }
  throw InputError(fmt::format("unknown check '{}'{}; there are {}", name, DidYouMean(name, names),
                               fmt::join(names, ", ")));
}

Examination Examine(const Registry& registry, const Case& c,
                    const std::function<void(const char*)>& on_check) {
  if (!c.check.empty()) FindCheck(c.check);
  return Examiner(registry, c).Run(on_check);
}

}  // namespace raybench::fuzz
