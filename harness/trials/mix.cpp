#include "harness/trials/mix.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "accel/base/random.h"

namespace raybench {
namespace {

constexpr uint64_t kRun = 64;  // as Thin() keeps together: an 8 x 8 tile

/// What the tracer itself asks for a picture.
constexpr const char* kPicture[] = {"camera", "shadow", "reflection", "refraction"};

MixWord ParseWord(const std::string& text) {
  const size_t equals = text.find('=');
  MixWord word{text.substr(0, equals), 1};
  if (equals != text.npos) {
    const std::string number = text.substr(equals + 1);
    char* end = nullptr;
    word.weight = std::strtod(number.c_str(), &end);
    if (number.empty() || *end != '\0' || !(word.weight > 0 && word.weight <= 1e9))
      throw InputError(fmt::format("--mix {}: the weight must be a number above 0, at most 1e9", text));
  }
  return word;
}

/// Deals the runs of a set out to both halves.
void Deal(MixedSet& set, uint64_t seed, uint64_t stream) {
  std::vector<uint32_t> runs;
  for (uint64_t i = 0; i < set.rays.size(); i += kRun) runs.push_back(uint32_t(i));
  Random random(seed, stream);
  for (size_t i = runs.size(); i > 1; --i) std::swap(runs[i - 1], runs[random.Below(i)]);
  const auto middle = runs.begin() + ptrdiff_t((runs.size() + 1) / 2);
  set.training.assign(runs.begin(), middle);
  set.held_out.assign(middle, runs.end());
  if (set.held_out.empty()) set.held_out = set.training;  // a single run: there is no other
}

}  // namespace

std::vector<rb_ray> MixedSet::Rays(bool held, uint64_t count) const {
  const std::vector<uint32_t>& half = held ? held_out : training;
  const uint64_t runs = std::clamp<uint64_t>((count + kRun / 2) / kRun, 1, half.size());
  std::vector<uint32_t> chosen(half.begin(), half.begin() + ptrdiff_t(runs));
  std::sort(chosen.begin(), chosen.end());
  std::vector<rb_ray> part;
  part.reserve(runs * kRun);
  for (const uint32_t start : chosen) {
    const uint64_t end = std::min<uint64_t>(start + kRun, rays.size());
    part.insert(part.end(), rays.begin() + ptrdiff_t(start), rays.begin() + ptrdiff_t(end));
  }
  return part;
}

uint64_t MixedSet::Count(bool held) const {
  uint64_t count = 0;
  for (const uint32_t start : held ? held_out : training)
    count += std::min<uint64_t>(kRun, rays.size() - start);
  return count;
}

std::vector<MixWord> ParseMix(const std::string& text) {
  std::vector<MixWord> words;
  if (text == "picture") {
    for (const char* name : kPicture) words.push_back({name, 0});
    return words;
  }
  for (const std::string& item : SplitSpecs(text)) words.push_back(ParseWord(item));
  std::vector<std::string> names;
  for (const MixWord& word : words) {
    if (std::count(names.begin(), names.end(), word.name) != 0)
      throw InputError(fmt::format("--mix {}: '{}' is given twice", text, word.name));
    names.push_back(word.name);
  }
  CheckFamilyNames("--mix", names, CapturedFamilies());
  return words;
}

std::vector<MixedSet> CaptureMix(const Registry& registry, const Scene& scene, const MixOptions& options) {
  const std::vector<MixWord> words = ParseMix(options.mix);
  CaptureOptions capture;
  capture.rays = 2 * options.rays, capture.seed = options.seed, capture.depth = options.depth;
  capture.note = [&](const std::string& line) {
    if (options.mix != "picture") fmt::print(stderr, "{}\n", line);
  };
  for (const MixWord& word : words) capture.sets.push_back(word.name);
  std::vector<SourcedSet> captured = CaptureRaySets(registry, scene, capture).sets;
  std::vector<MixedSet> mix;
  double sum = 0;
  for (const MixWord& word : words) {
    // The sets of one family share its weight as the tracer asked for them.
    double rays = 0;
    const auto named = [&](const SourcedSet& s) {
      return s.set.Label() == word.name || s.set.kind == word.name;
    };
    for (const SourcedSet& s : captured)
      if (named(s)) rays += double(s.captured);
    for (SourcedSet& s : captured) {
      if (!named(s) || s.set.rays.empty()) continue;
      MixedSet set;
      set.label = s.set.Label(), set.query = s.set.query, set.rays = std::move(s.set.rays);
      set.share = word.weight == 0 ? double(s.captured) : word.weight * double(s.captured) / rays;
      sum += set.share;
      Deal(set, options.seed, mix.size());
      mix.push_back(std::move(set));
    }
  }
  if (mix.empty())
    throw InputError(fmt::format("scene '{}' has no rays of --mix {}", scene.name, options.mix));
  for (MixedSet& set : mix) set.share /= sum;
  return mix;
}

}  // namespace raybench
