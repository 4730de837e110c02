#include "harness/cli/picture_options.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>

#include "accel/host/names.h"
#include "datasets/scene/needs.h"
#include "datasets/scene/text.h"
#include "harness/cli/commands.h"

namespace raybench {
namespace {

template <class T>
struct Choice {
  const char* name;
  T value;
};

constexpr Choice<SamplePattern> kPatterns[] = {{"center", SamplePattern::kCenter},
                                               {"corners", SamplePattern::kCorners},
                                               {"uniform", SamplePattern::kUniform},
                                               {"jittered", SamplePattern::kJittered},
                                               {"low-discrepancy", SamplePattern::kLowDiscrepancy}};
constexpr Choice<ReconstructionFilter> kFilters[] = {{"box", ReconstructionFilter::kBox},
                                                     {"tent", ReconstructionFilter::kTent},
                                                     {"gaussian", ReconstructionFilter::kGaussian},
                                                     {"mitchell", ReconstructionFilter::kMitchell}};
constexpr Choice<SelfIntersection> kCures[] = {{"error-bound", SelfIntersection::kErrorBound},
                                               {"none", SelfIntersection::kNone},
                                               {"tnear", SelfIntersection::kFixedTnear},
                                               {"normal-offset", SelfIntersection::kNormalOffset},
                                               {"integer-offset", SelfIntersection::kIntegerOffset},
                                               {"skip", SelfIntersection::kSkip}};
constexpr Choice<FresnelMode> kFresnelModes[] = {
    {"material", FresnelMode::kMaterial}, {"on", FresnelMode::kOn}, {"off", FresnelMode::kOff}};
constexpr Choice<ShadowQuery> kShadows[] = {{"any", ShadowQuery::kAny}, {"closest", ShadowQuery::kClosest}};
constexpr Choice<TraceRules> kRules[] = {{"whitted", TraceRules::kWhitted}, {"spd", TraceRules::kSpd}};

/// Formats that a map of the surroundings comes in, by ending.
constexpr Choice<const char*> kMapFormats[] = {{".exr", "image/x-exr"},
                                               {".hdr", "image/vnd.radiance"},
                                               {".png", "image/png"},
                                               {".jpg", "image/jpeg"},
                                               {".jpeg", "image/jpeg"}};

template <class T, size_t n>
std::string Names(const Choice<T> (&choices)[n]) {
  std::string names;
  for (const Choice<T>& choice : choices)
    names += fmt::format("{}{}", names.empty() ? "" : ", ", choice.name);
  return names;
}

template <class T, size_t n>
T Chosen(const char* option, const std::string& text, const Choice<T> (&choices)[n]) {
  for (const Choice<T>& choice : choices)
    if (text == choice.name) return choice.value;
  std::vector<std::string_view> known;
  for (const Choice<T>& choice : choices) known.push_back(choice.name);
  throw InputError(
      fmt::format("{} {}{}: allowed are {}", option, text, DidYouMean(text, known), Names(choices)));
}

/// "0.1,0.2,0.3", each finite and at least 0.
Vec3f ParseColor(const char* option, const std::string& text) {
  Vec3f color{};
  const char *at = text.data(), *const end = at + text.size();
  for (int i = 0; i < 3; ++i) {
    const auto [next, error] = std::from_chars(at, end, color[i]);
    const bool good = error == std::errc() && std::isfinite(color[i]) && color[i] >= 0 &&
                      (i < 2 ? next != end && *next == ',' : next == end);
    if (!good)
      throw InputError(fmt::format("{} {}: write R,G,B, each a number of at least 0", option, OneLine(text)));
    at = next + 1;
  }
  return color;
}

Texture ReadMap(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  Texture map;
  for (const auto& format : kMapFormats)
    if (ending == format.name) map.mime_type = format.value;
  if (map.mime_type.empty())
    throw InputError(
        fmt::format("--environment {}: allowed are files ending in {}", path, Names(kMapFormats)));
  map.name = "environment";
  map.source = path;
  map.bytes = std::make_shared<const std::string>(ReadFile(path));
  map.wrap_v = TextureWrap::kClampToEdge;  // the poles are no neighbours
  return map;
}

}  // namespace

std::vector<CLI::Option*> AddPictureOptions(CLI::App& command, PictureOptions& options) {
  const auto choice = [&](const char* name, auto& value, const std::string& doc, const char* type) {
    return command.add_option(name, value, doc)->type_name(type);
  };
  return {choice("--samples", options.samples, "N x N camera rays per pixel, N up to 64; default 1", "N")
              ->transform(WholeNumber(1, 64)),
          choice("--pattern", options.pattern,
                 fmt::format("Positions of the camera rays in a pixel: {}; corners are shared between "
                             "pixels. Default center, with --samples jittered",
                             Names(kPatterns)),
                 "PATTERN"),
          choice("--filter", options.filter,
                 fmt::format("Filter that turns samples into pixels: {}; default box", Names(kFilters)),
                 "FILTER"),
          choice("--adaptive", options.adaptive,
                 "Take all samples only where colours differ by more than this, elsewhere one; 0 to 1",
                 "CONTRAST")
              ->transform(RealNumber(0, 1)),
          choice("--sampling-seed", options.sampling_seed,
                 "Seed of jittered and low-discrepancy samples; default 1", "N")
              ->transform(WholeNumber()),
          choice("--rules", options.rules,
                 "Rays to trace: those of the illumination model (whitted) or those that are counted for the "
                 "Standard Procedural Databases (spd); default whitted",
                 "RULES"),
          choice("--self-intersection", options.self_intersection,
                 fmt::format(
                     "Method that keeps a ray from hitting the surface it starts on: {}; default error-bound",
                     Names(kCures)),
                 "CURE"),
          choice("--self-intersection-size", options.self_intersection_size,
                 "Size of tnear or of the normal-offset, in units of the scene; default 1e-4", "X")
              ->transform(RealNumber(0, double(std::numeric_limits<float>::max()))),
          choice("--fresnel", options.fresnel,
                 fmt::format("Fresnel's equations for transmitting materials: {}; default material (where "
                             "the material asks for them)",
                             Names(kFresnelModes)),
                 "MODE"),
          choice("--shadows", options.shadows,
                 "What shadow rays ask where nothing lets light through: is anything in the way (any), or "
                 "what is nearest (closest): the same picture in more time; default any",
                 "QUERY"),
          choice("--min-contribution", options.min_contribution,
                 "End paths that add less than this to a pixel; 0 to 1, default 0: end none", "X")
              ->transform(RealNumber(0, 1)),
          choice("--needs", options.needs,
                 "Model what this scene needs (scene) or what any scene may need (all): the same picture "
                 "with more work and memory; default scene",
                 "WHAT")
              ->check(CLI::IsMember({"scene", "all"})),
          choice("--background", options.background, "Colour of rays that miss, linear; default the scene's",
                 "R,G,B"),
          choice("--environment", options.environment,
                 fmt::format("Picture of the surroundings by latitude and longitude, for rays that miss: {}",
                             Names(kMapFormats)),
                 "FILE")};
}

void SetTraceOptions(const PictureOptions& options, TraceOptions& trace) {
  Sampling& sampling = trace.sampling;
  sampling.grid = options.samples.value_or(1);
  sampling.pattern = options.pattern     ? Chosen("--pattern", *options.pattern, kPatterns)
                     : sampling.grid > 1 ? SamplePattern::kJittered
                                         : SamplePattern::kCenter;
  if (options.filter) sampling.filter = Chosen("--filter", *options.filter, kFilters);
  sampling.adaptive_contrast = options.adaptive.value_or(0);
  sampling.seed = options.sampling_seed;
  const bool corners = sampling.pattern == SamplePattern::kCorners;
  if (sampling.grid > 1 && (corners || sampling.pattern == SamplePattern::kCenter))
    throw InputError(
        fmt::format("--samples {}: --pattern {} takes one a pixel; allowed with more are "
                    "uniform, jittered, low-discrepancy",
                    sampling.grid, *options.pattern));
  if (corners && sampling.filter != ReconstructionFilter::kBox)
    throw InputError("--filter: with --pattern corners a pixel is the mean of its corners; leave it out");
  if (sampling.adaptive_contrast > 0 && sampling.grid == 1)
    throw InputError("--adaptive: needs --samples of at least 2, the most a pixel gets");

  trace.all_needs = options.needs == "all";
  trace.rules = Chosen("--rules", options.rules, kRules);
  if (trace.rules == TraceRules::kSpd) {
    for (const auto& [name, given] : {std::pair("--self-intersection", options.self_intersection.has_value()),
                                      std::pair("--fresnel", options.fresnel.has_value()),
                                      std::pair("--min-contribution", options.min_contribution.has_value())})
      if (given) throw InputError(fmt::format("{}: --rules spd fixes this; leave it out", name));
  }
  if (options.self_intersection)
    trace.self_intersection = Chosen("--self-intersection", *options.self_intersection, kCures);
  if (options.self_intersection_size) {
    const float size = *options.self_intersection_size;
    if (trace.self_intersection != SelfIntersection::kFixedTnear &&
        trace.self_intersection != SelfIntersection::kNormalOffset)
      throw InputError("--self-intersection-size: only --self-intersection tnear and normal-offset have one");
    if (!(size >= 0) || !std::isfinite(size))
      throw InputError(
          fmt::format("--self-intersection-size {}: a finite number of at least 0 is needed", size));
    trace.self_intersection_size = size;
  }
  if (options.fresnel) trace.fresnel = Chosen("--fresnel", *options.fresnel, kFresnelModes);
  if (options.shadows) trace.shadows = Chosen("--shadows", *options.shadows, kShadows);
  trace.min_contribution = options.min_contribution.value_or(0);
}

void SetBackground(const PictureOptions& options, Scene& scene) {
  if (options.background && options.environment)
    throw InputError("--background: give this or --environment, not both");
  if (options.background) {
    scene.background = ParseColor("--background", *options.background);
    scene.environment = -1;
  }
  if (options.environment) {
    scene.textures.push_back(ReadMap(*options.environment));
    scene.environment = int32_t(scene.textures.size() - 1);
  }
}

uint64_t BuildNeedsOf(const Scene& scene, const TraceOptions& trace, const rb_structure& structure) {
  uint64_t needs = (trace.all_needs ? AllNeedsOf(scene) : NeedsOf(scene)).BuildNeeds();
  // By these rules everything blocks light.
  if (trace.rules == TraceRules::kSpd) needs = (needs & RB_NEED_UV) | RB_NEED_ANY;
  if (trace.shadows == ShadowQuery::kClosest) needs &= ~uint64_t{RB_NEED_ANY};
  if (trace.self_intersection == SelfIntersection::kSkip) needs |= RB_NEED_SKIP;
  if ((needs & RB_NEED_SKIP) != 0 && (structure.capabilities & RB_CAN_SKIP) == 0)
    throw InputError(
        fmt::format("--self-intersection skip: structure '{}' cannot skip a primitive", structure.name));
  return needs;
}

}  // namespace raybench
