#include "harness/rays/ray_sets.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "datasets/models/fetch.h"
#include "datasets/scene/needs.h"
#include "harness/plan/build_options.h"
#include "harness/rays/from_inside.h"
#include "harness/terminal/interrupt.h"
#include "tracer/hemisphere.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// A captured set with fewer than 1/16 of the rays wanted is too small to time beside the others.
constexpr uint64_t kSmallSet = 16;

constexpr RayFamily kCaptured[] = {
    {"camera", "closest", "of the picture, in tiles of 8 x 8 pixels"},
    {"shadow", "any", "from hits at depth N to the lights, up to just before them", true},
    {"reflection", "closest", "of the N-th bounce", true},
    {"refraction", "closest", "of the N-th bounce", true},
    {"random", "closest", "isotropic lines through the scene's bounding sphere"},
    {"diffuse", "closest", "cosine-distributed, from first hits of camera rays"},
    {"ambient_occlusion", "any",
     "the same, 8 from each point, as long as a tenth of the diagonal of the scene's bounds"},
    {"aimed", "closest", "from inside at edges and vertices, which random rays miss"}};

bool Names(const std::string& name, const RaySet& set) { return name == set.Label() || name == set.kind; }

class Capturer {
 public:
  Capturer(const Registry& registry, const Scene& scene, const CaptureOptions& options)
      : scene_(scene),
        options_(options),
        tree_(ParseContestant(registry, "bvh_sah"), scene.Geometry(),
              BuildOptions(0, options.seed, NeedsOf(scene).BuildNeeds())) {}

  Capture Run() {
    // Twice as many pixels as rays wanted: reflected and refracted rays cover only part of a picture.
    uint32_t side = 256;
    while (uint64_t{side} * side < 2 * options_.rays) side += 8;
    TraceOptions trace;
    trace.width = trace.height = side;
    trace.max_depth = options_.depth;
    trace.capture = true;
    trace.progress = options_.progress;
    TraceResult result = Trace(scene_, tree_, trace);
    ThrowIfInterrupted();
    capture_.image = std::move(result.image);
    AddTraced(result.ray_sets);
    AddSynthetic(result.ray_sets);
    CheckFound();
    return std::move(capture_);
  }

 private:
  bool Wanted(const RaySet& set) const {
    return options_.sets.empty() || std::any_of(options_.sets.begin(), options_.sets.end(),
                                                [&](const std::string& name) { return Names(name, set); });
  }

  void Add(const RaySet& set) {
    capture_.sets.push_back({Thin(set, options_.rays, scene_.bounds()), set.rays.size(), {}, {}, {}});
  }

  void AddTraced(const std::vector<RaySet>& traced) {
    std::map<std::string, uint64_t> largest;
    for (const RaySet& set : traced)
      largest[set.kind] = std::max<uint64_t>(largest[set.kind], set.rays.size());
    for (const RaySet& set : traced) {
      if (!Wanted(set)) continue;
      const bool named = std::count(options_.sets.begin(), options_.sets.end(), set.Label()) != 0;
      if (!named && set.rays.size() * kSmallSet < options_.rays && set.rays.size() < largest[set.kind]) {
        options_.note(fmt::format("{} has only {} rays and is left out", set.Label(), set.rays.size()));
        continue;
      }
      Add(set);
      if (options_.shuffled) Add(Shuffle(capture_.sets.back().set, options_.seed, scene_.bounds()));
    }
  }

  void AddSynthetic(const std::vector<RaySet>& traced) {
    const uint64_t rays = options_.rays, seed = options_.seed;
    if (WantedKind("random")) Add(RandomRays(scene_, rays, seed));
    const auto camera =
        std::find_if(traced.begin(), traced.end(), [](const RaySet& set) { return set.kind == "camera"; });
    if (camera != traced.end()) {
      AddHemisphere("diffuse", &DiffuseBounce, *camera);
      AddHemisphere("ambient_occlusion", &AmbientOcclusion, *camera);
    }
    // Random rays hide leaks; these are aimed at edges and vertices.
    if (!scene_.triangles.empty() && WantedKind("aimed")) Add(AimedRays(scene_, rays, seed));
  }

  template <class Make>
  void AddHemisphere(const char* kind, const Make& make, const RaySet& camera) {
    if (!WantedKind(kind)) return;
    ThrowIfInterrupted();
    const RaySet set = make(scene_, tree_, camera, options_.rays, options_.seed);
    if (!set.rays.empty()) {
      Add(set);
    } else {
      options_.note(fmt::format("no camera ray hits anything, so there are no {} rays", kind));
    }
  }

  bool WantedKind(const char* kind) const {
    RaySet set;
    set.kind = kind;
    return Wanted(set);
  }

  /// A name that fits no set is noted; that none fits at all is an error.
  void CheckFound() const {
    for (const std::string& name : options_.sets) {
      const bool found = std::any_of(capture_.sets.begin(), capture_.sets.end(),
                                     [&](const SourcedSet& s) { return Names(name, s.set); });
      if (!found) options_.note(fmt::format("there are no rays of set {}", name));
    }
    if (capture_.sets.empty())
      throw InputError(fmt::format("scene '{}' has no rays of the sets named by --sets", scene_.name));
  }

  const Scene& scene_;
  const CaptureOptions& options_;
  const Tree tree_;
  Capture capture_;
};

bool SameName(const RaySet& a, const RaySet& b) { return a.Label() == b.Label() && a.order == b.order; }

/// The label of a set replayed from `path`: the stem, without the ".shuffled" that tells a twin's file from
/// its own.
std::string LabelOf(const fs::path& path, const RaySet& set) {
  std::string label = path.stem().string();
  const std::string twin = ".shuffled";
  if (set.order == "shuffled" && label.size() > twin.size() && label.ends_with(twin))
    label.resize(label.size() - twin.size());
  for (char& c : label) {
    const bool keep =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.';
    if (!keep) c = '_';
  }
  return label;
}

}  // namespace

const char* QueryName(uint32_t query) { return query == RB_ANY ? "any" : "closest"; }

std::span<const RayFamily> CapturedFamilies() { return kCaptured; }

Capture CaptureRaySets(const Registry& registry, const Scene& scene, const CaptureOptions& options) {
  CheckFamilyNames("--sets", options.sets, kCaptured);
  return Capturer(registry, scene, options).Run();
}

std::vector<std::string> RayFiles(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    std::error_code error;
    if (!fs::exists(path, error)) throw InputError(fmt::format("{}: there is no such file", path));
    if (!fs::is_directory(path, error)) {
      files.push_back(path);
      continue;
    }
    std::set<std::string> inside;
    for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error))
      if (it->path().extension() == ".rays") inside.insert(it->path().string());
    if (error) throw InputError(fmt::format("{}: cannot be read: {}", path, error.message()));
    if (inside.empty()) throw InputError(fmt::format("{}: has no .rays files", path));
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

std::vector<std::vector<SourcedSet>> ReplayRayFiles(const std::vector<std::string>& files,
                                                    std::span<const Scene* const> scenes, uint64_t limit) {
  std::vector<std::vector<SourcedSet>> sets(scenes.size());
  for (const std::string& path : files) {
    ThrowIfInterrupted();
    const RayFile file = ReadRayFile(path);
    bool fits = false;
    for (size_t i = 0; i < scenes.size(); ++i) {
      if (file.header.scene_hash != scenes[i]->hash()) continue;
      fits = true;
      SourcedSet replayed{ReplayedSet(file, *scenes[i]), file.rays.size(), path, Sha256OfFile(path),
                          file.header.software};
      if (limit != 0) replayed.set = Thin(replayed.set, limit, scenes[i]->bounds());
      replayed.set.name = LabelOf(path, replayed.set);
      for (const SourcedSet& other : sets[i])
        if (SameName(other.set, replayed.set))
          throw InputError(fmt::format("{} and {} would both be ray set '{}'; rename one", other.file, path,
                                       replayed.set.name));
      sets[i].push_back(std::move(replayed));
    }
    if (fits) continue;
    std::string names;
    for (const Scene* scene : scenes)
      names += fmt::format("{}'{}' (hash {})", names.empty() ? "" : " or ", scene->name, scene->hash());
    throw InputError(fmt::format("{}: was recorded in '{}' (hash {}), not in {}", path, file.header.scene,
                                 file.header.scene_hash, names));
  }
  for (size_t i = 0; i < scenes.size(); ++i)
    if (sets[i].empty())
      throw InputError(fmt::format("scene '{}' (hash {}): none of the ray files was recorded in it",
                                   scenes[i]->name, scenes[i]->hash()));
  return sets;
}

void AddShuffledTwins(std::vector<SourcedSet>& sets, uint64_t seed, const Bounds3& bounds) {
  std::vector<SourcedSet> all;
  for (const SourcedSet& s : sets) {
    all.push_back(s);
    SourcedSet twin = s;
    twin.set.order = "shuffled";
    const bool there =
        std::any_of(sets.begin(), sets.end(), [&](const SourcedSet& o) { return SameName(o.set, twin.set); });
    if (there) continue;
    twin.set = Shuffle(s.set, seed, bounds);
    all.push_back(std::move(twin));
  }
  sets = std::move(all);
}

Json FactsOf(const SourcedSet& s) {
  const auto text = [](const std::string& value) { return value.empty() ? Json() : Json(value); };
  return {{"ray_set", s.set.Label()},
          {"kind", s.set.kind},
          {"depth", s.set.depth},
          {"order", s.set.order},
          {"query", QueryName(s.set.query)},
          {"rays", s.set.rays.size()},
          {"captured_rays", s.captured},
          {"invalid_rays", s.set.invalid_rays},
          {"outside_rays", s.set.outside_rays},
          {"hash", s.set.hash},
          {"file", text(s.file)},
          {"file_sha256", text(s.sha256)},
          {"file_software", text(s.software)}};
}

}  // namespace raybench
