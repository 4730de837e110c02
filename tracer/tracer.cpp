// How a picture is made. Samples of the image plane are walked in bands. Within a band, everything at one
// depth is done in batches:
//
//   paths of depth d --closest hits--> shading --shadow rays--> visibility --> colours --> samples --> film
//                                        \--reflected and refracted rays--> paths of depth d + 1
//
// Paths stand in the order of their samples (tiles of 8 x 8 pixels), those of one sample side by side; each
// batch is a subsequence of them. Work is cut into chunks of fixed size whose outputs are concatenated in
// order, each sample is summed up in the order of its paths, and each pixel in the order of its samples: so
// pictures and ray sets depend neither on the thread count nor on the size of bands.
//
// What rays pass, holes cut out by alpha and for shadow rays also what transmits, is passed in rounds: those
// rays that may go on are asked again, for hits behind the last one in the order (t, prim).
#include "tracer/tracer.h"

#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "tracer/camera_rays.h"
#include "tracer/film.h"
#include "tracer/shader.h"
#include "tracer/workers.h"

namespace raybench {
namespace {

void QueryChunks(Workers& workers, const Tree& tree, const rb_query& query) {
  if (query.counts && !tree.structure().query_counted)
    throw InputError(std::string("structure ") + tree.structure().name + " cannot count");
  workers.ForChunks(query.n, [&](size_t, size_t begin, size_t end) {
    rb_query part = query;
    part.n = end - begin;
    part.rays += begin;
    if (part.skip) part.skip += begin;
    if (part.after) part.after += begin;
    if (part.hits) part.hits += begin;
    if (part.occluded) part.occluded += begin;
    if (part.counts) part.counts += begin;
    part.counts ? tree.QueryCounted(part) : tree.Query(part);
  });
}

rb_query MakeQuery(uint32_t kind, const Batch& batch) {
  rb_query query{};
  query.struct_size = sizeof query;
  query.kind = kind;
  query.n = batch.rays.size();
  query.rays = batch.rays.data();
  if (!batch.skip.empty()) query.skip = batch.skip.data();
  return query;
}

void FindHits(Workers& workers, const Tree& tree, const Batch& batch, std::vector<rb_hit>& hits) {
  hits.resize(batch.rays.size());
  rb_query query = MakeQuery(RB_CLOSEST, batch);
  query.hits = hits.data();
  QueryChunks(workers, tree, query);
}

[[noreturn]] void ThrowInvented(const Scene& scene, const Tree& tree, const rb_hit& hit) {
  throw std::runtime_error(std::string("structure ") + tree.structure().name + " answered with primitive " +
                           std::to_string(hit.prim) + " of " + std::to_string(scene.primitive_count()));
}

/// False on a miss. Throws if the structure names a primitive that does not exist.
inline bool IsHit(const Scene& scene, const Tree& tree, const rb_hit& hit) {
  if (hit.prim == RAYBENCH_NONE) return false;
  if (hit.prim >= scene.primitive_count()) [[unlikely]]
    ThrowInvented(scene, tree, hit);
  return true;
}

void ConcatenateBatches(Workers& workers, size_t count, Batch& all, const auto& part) {
  Concatenate(
      workers, count, all.rays, [&](size_t i) -> auto& { return part(i).rays; });
  Concatenate(
      workers, count, all.skip, [&](size_t i) -> auto& { return part(i).skip; });
}

/// Follows rays through the hits that they pass.
class Walk {
 public:
  Walk(const Scene& scene, const Tree& tree, Workers& workers)
      : scene_(scene), tree_(tree), workers_(workers) {}

  /// `passes(i, hit)` is asked about each hit of ray i, nearest first, until it says false: whether the ray
  /// goes on through it. hits[i], the first hit on entry, is the one it ended at, or a miss. Returns how many
  /// hits were passed.
  template <class Passes>
  uint64_t Run(const Batch& batch, std::vector<rb_hit>& hits, const Passes& passes) {
    if (batch.rays.size() > 0xFFFFFFFFu)
      throw InputError("more than 2^32 rays in a batch: trace smaller bands");
    uint64_t passed = 0;
    KeepActive(batch.rays.size(), hits, passes, [](size_t k) { return uint32_t(k); });
    for (; !active_.empty(); KeepActive(active_.size(), hits, passes, [&](size_t k) { return active_[k]; })) {
      passed += active_.size();
      Resume(batch, hits);
    }
    return passed;
  }

 private:
  template <class Passes, class RayOf>
  void KeepActive(size_t count, const std::vector<rb_hit>& hits, const Passes& passes, const RayOf& ray_of) {
    const size_t chunks = Workers::ChunkCount(count);
    if (parts_.size() < chunks) parts_.resize(chunks);
    workers_.ForChunks(count, [&](size_t chunk, size_t begin, size_t end) {
      parts_[chunk].clear();
      for (size_t k = begin; k < end; ++k) {
        const uint32_t i = ray_of(k);
        if (IsHit(scene_, tree_, hits[i]) && passes(i, hits[i])) parts_[chunk].push_back(i);
      }
    });
    Concatenate(
        workers_, chunks, active_, [&](size_t i) -> auto& { return parts_[i]; });
  }

  void Resume(const Batch& batch, std::vector<rb_hit>& hits) {
    const size_t n = active_.size();
    rest_.rays.resize(n);
    after_.resize(n);
    rest_.skip.resize(batch.skip.empty() ? 0 : n);
    workers_.ForChunks(n, [&](size_t, size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const uint32_t i = active_[k];
        rest_.rays[k] = batch.rays[i];
        rest_.rays[k].tnear = hits[i].t;
        after_[k] = hits[i].prim;
        if (!batch.skip.empty()) rest_.skip[k] = batch.skip[i];
      }
    });
    found_.resize(n);
    rb_query query = MakeQuery(RB_CLOSEST, rest_);
    query.after = after_.data();
    query.hits = found_.data();
    QueryChunks(workers_, tree_, query);
    workers_.ForChunks(n, [&](size_t, size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const rb_hit &last = hits[active_[k]], &next = found_[k];
        if (next.prim != RAYBENCH_NONE && !(next.t > last.t || (next.t == last.t && next.prim > last.prim)))
          throw std::runtime_error(std::string("structure ") + tree_.structure().name +
                                   " answered with a hit that is not behind the last one");
        hits[active_[k]] = next;
      }
    });
  }

  const Scene& scene_;
  const Tree& tree_;
  Workers& workers_;
  std::vector<std::vector<uint32_t>> parts_;
  std::vector<uint32_t> active_, after_;
  Batch rest_;
  std::vector<rb_hit> found_;
};

/// A sample of the image plane: cell's slot (TiledCells) and number within it.
struct SampleId {
  uint32_t slot, index;
};

/// What rays meet, and what happens there.
struct World {
  World(const Scene& scene_in, const Tree& tree_in, const TraceOptions& options, Workers& workers)
      : scene(scene_in), tree(tree_in), shader(scene, options), walk(scene, tree, workers) {
    const uint64_t can = tree.structure().capabilities;
    const auto require = [&](bool needed, uint64_t capability, const char* what) {
      if (needed && (can & capability) == 0)
        throw InputError(std::string("structure ") + tree.structure().name + " cannot " + what);
    };
    require(shader.gathers() || shader.has_holes(), RB_CAN_AFTER,
            "go on behind a hit, which scenes with transmitting or cut-out surfaces need");
    require(options.self_intersection == SelfIntersection::kSkip, RB_CAN_SKIP,
            "skip a primitive, which this cure against self-intersection needs");
  }

  const Scene& scene;
  const Tree& tree;
  Shader shader;
  Walk walk;
};

class Wavefront {
 public:
  Wavefront(const Scene& scene, const Tree& tree, const TraceOptions& options,
            const SecondaryScene* secondary)
      : options_(options),
        sampling_(options.sampling),
        cells_(CellsOf(options)),
        camera_(scene, options.width, options.height),
        max_depth_(options.rules == TraceRules::kSpd ? 4 : options.max_depth),
        workers_(options.threads),
        band_(std::min(options.band_rays, workers_.threads() * uint32_t{8 * Workers::kChunk})),
        first_(scene, tree, options, workers_),
        rest_(secondary == nullptr ? first_
                                   : coarse_.emplace(secondary->scene, secondary->tree, options, workers_)),
        film_(options.width, options.height, options.sampling) {}

  TraceResult Run() {
    const uint32_t per_cell = sampling_.PixelSamples();
    if (sampling_.adaptive_contrast > 0 && per_cell > 1) {
      TraceAdaptively();
    } else {
      const auto sample = [&](uint64_t i) {
        return per_cell == 1 ? SampleId{uint32_t(i), 0}
                             : SampleId{uint32_t(i / per_cell), uint32_t(i % per_cell)};
      };
      TracePass(cells_.size() * per_cell, sample, 0, 1, [&](uint64_t begin) { AddToFilm(begin, sample, 1); });
    }
    std::erase_if(result_.ray_sets, [](const RaySet& set) { return set.rays.empty(); });
    for (RaySet& set : result_.ray_sets) Freeze(set, first_.scene.bounds());
    result_.image = film_.Develop();
    return std::move(result_);
  }

 private:
  static TiledCells CellsOf(const TraceOptions& options) {
    const bool corners = options.sampling.pattern == SamplePattern::kCorners;
    return {options.width + corners, options.height + corners};
  }

  /// One sample a pixel, then the others of those pixels that differ from a neighbour.
  void TraceAdaptively() {
    const uint32_t per_cell = sampling_.PixelSamples(), first = sampling_.FirstSample();
    const uint32_t width = cells_.width(), height = cells_.height();
    std::vector<Vec3f> colors(cells_.size());  // row by row
    const auto at = [&](uint32_t x, uint32_t y) -> Vec3f& { return colors[size_t{y} * width + x]; };
    TracePass(
        cells_.size(),
        [&](uint64_t i) {
          return SampleId{uint32_t(i), first};
        },
        0, 0.5,
        [&](uint64_t begin) {
          for (size_t i = 0; i < samples_.size(); ++i) {
            const auto [x, y] = cells_.At(uint32_t(begin + i));
            at(x, y) = samples_[i];
          }
        });

    const auto differs = [&](TiledCells::Cell cell) {
      const Vec3f own = Shown(at(cell.x, cell.y));
      for (uint32_t y = cell.y - (cell.y > 0); y <= std::min(cell.y + 1, height - 1); ++y)
        for (uint32_t x = cell.x - (cell.x > 0); x <= std::min(cell.x + 1, width - 1); ++x) {
          const Vec3f d = Shown(at(x, y)) - own;
          if (std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}) > sampling_.adaptive_contrast)
            return true;
        }
      return false;
    };
    // All samples of a pixel weigh as much as the only one of another.
    const float share = 1 / float(per_cell);
    std::vector<uint32_t> refined;
    for (uint32_t slot = 0; slot < cells_.size(); ++slot) {
      const TiledCells::Cell cell = cells_.At(slot);
      const bool refine = differs(cell);
      if (refine) refined.push_back(slot);
      film_.Add(cell.x, cell.y, first, at(cell.x, cell.y), refine ? share : 1);
    }
    const auto sample = [&](uint64_t i) {
      const auto index = uint32_t(i % (per_cell - 1));
      return SampleId{refined[i / (per_cell - 1)], index + (index >= first)};
    };
    TracePass(uint64_t{refined.size()} * (per_cell - 1), sample, 0.5, 1,
              [&](uint64_t begin) { AddToFilm(begin, sample, share); });
  }
  static Vec3f Shown(Vec3f color) { return Max(Min(color, Vec3f{1, 1, 1}), Vec3f{0, 0, 0}); }

  /// Traces samples 0 .. count - 1, band by band; `done(begin)` finds those from `begin` on in samples_.
  template <class SampleOf, class Done>
  void TracePass(uint64_t count, const SampleOf& sample_of, double progress_from, double progress_to,
                 const Done& done) {
    const uint64_t bands = (count + band_ - 1) / band_;
    const auto report = [&](double finished) {
      if (options_.progress)
        options_.progress(progress_from + (progress_to - progress_from) * (finished / double(bands)));
    };
    for (uint64_t band = 0; band < bands; ++band) {
      const uint64_t begin = band * band_;
      StartBand(begin, std::min<uint64_t>(count, begin + band_), sample_of);
      for (uint32_t depth = 0; !level_.paths.empty(); ++depth) {
        TraceLevel(depth);
        if (depth < max_depth_) report(double(band) + (depth + 1.0) / (max_depth_ + 1.0));
      }
      done(begin);
      report(double(band + 1));
    }
    if (bands == 0 && options_.progress) options_.progress(progress_to);
  }

  template <class SampleOf>
  void AddToFilm(uint64_t begin, const SampleOf& sample_of, float weight) {
    const auto add = [&](size_t i) {
      const auto [slot, index] = sample_of(begin + i);
      const auto [x, y] = cells_.At(slot);
      film_.Add(x, y, index, samples_[i], weight);
    };
    if (film_.OneSampleEach()) {
      workers_.ForChunks(samples_.size(), [&](size_t, size_t from, size_t to) {
        for (size_t i = from; i < to; ++i) add(i);
      });
    } else {
      for (size_t i = 0; i < samples_.size(); ++i) add(i);
    }
  }

  void AddSetsOf(uint32_t depth) {
    if (depth == 0) AddSet("camera", depth, RB_CLOSEST);
    if (depth > 0) {
      AddSet("reflection", depth, RB_CLOSEST);
      AddSet("refraction", depth, RB_CLOSEST);
    }
    AddSet("shadow", depth, RB_ANY);
  }
  void AddSet(const char* kind, uint32_t depth, uint32_t query) {
    RaySet& set = result_.ray_sets.emplace_back();
    set.kind = kind;
    set.depth = depth;
    set.order = "traced";
    set.query = query;
  }
  /// Index of a set in the order AddSetsOf() makes them: camera, shadow.0, reflection.1, refraction.1,
  /// shadow.1, ...
  static size_t SetIndex(uint32_t depth, RayKind kind) {
    return depth == 0 ? 0 : 3 * size_t{depth} - 1 + kind;
  }
  static size_t ShadowSetIndex(uint32_t depth) { return 3 * size_t{depth} + 1; }

  /// Moves a finished batch into its set.
  void Capture(size_t set, std::vector<rb_ray>& batch) {
    if (!options_.capture) return;
    std::vector<rb_ray>& rays = result_.ray_sets[set].rays;
    if (rays.empty()) {
      rays = std::move(batch);
      batch = {};
    } else {
      for (const rb_ray& ray : batch) rays.push_back(ray);
    }
  }

  template <class SampleOf>
  void StartBand(uint64_t begin, uint64_t end, const SampleOf& sample_of) {
    level_.Clear();
    level_.paths.resize(end - begin);
    level_.batches[kReflection].rays.resize(end - begin);
    samples_.assign(end - begin, Vec3f{0, 0, 0});
    workers_.ForChunks(end - begin, [&](size_t, size_t from, size_t to) {
      for (size_t i = from; i < to; ++i) {
        const auto [slot, index] = sample_of(begin + i);
        const auto [x, y] = cells_.At(slot);
        const Vec2f offset = SampleOffset(sampling_, x, y, index);
        level_.paths[i] = {{1, 1, 1}, uint32_t(i), kReflection, uint32_t(i) & 0x7FFFFFFFu};
        level_.batches[kReflection].rays[i] =
            camera_.Through(x + double(offset.u), y + double(offset.v), first_.shader.tnear());
      }
    });
  }

  void TraceLevel(uint32_t depth) {
    if (options_.capture && result_.ray_sets.size() <= ShadowSetIndex(depth)) AddSetsOf(depth);
    World& met = depth == 0 ? first_ : rest_;
    for (uint32_t kind = 0; kind < kRayKinds; ++kind) {
      const Batch& batch = level_.batches[kind];
      FindHits(workers_, met.tree, batch, hits_[kind]);
      if (met.shader.has_holes())
        met.walk.Run(batch, hits_[kind], [&](size_t, const rb_hit& hit) { return met.shader.IsHole(hit); });
    }
    (depth == 0 ? result_.camera_rays : result_.reflection_rays) += level_.batches[kReflection].rays.size();
    result_.refraction_rays += level_.batches[kRefraction].rays.size();

    const size_t chunks = Workers::ChunkCount(level_.paths.size());
    if (outputs_.size() < chunks) outputs_.resize(chunks);
    Shade(met, depth >= max_depth_);
    for (size_t chunk = 0; chunk < chunks; ++chunk) {
      (depth == 0 ? result_.camera_hits : result_.reflection_hits) += outputs_[chunk].hits[kReflection];
      result_.refraction_hits += outputs_[chunk].hits[kRefraction];
      result_.shadow_rays += outputs_[chunk].shadow.rays.size();
      result_.shadow_blocked += outputs_[chunk].blocked;
    }
    CountWave(depth, chunks);
    for (uint32_t kind = 0; kind < kRayKinds; ++kind)
      Capture(SetIndex(depth, RayKind(kind)), level_.batches[kind].rays);
    if (rest_.shader.gathers() || options_.capture)
      ConcatenateBatches(
          workers_, chunks, shadow_, [&](size_t i) -> auto& { return outputs_[i].shadow; });
    if (rest_.shader.gathers()) {
      const uint64_t before = result_.shadow_blocked;
      GatherLight(chunks);
      result_.waves[depth].blocked += result_.shadow_blocked - before;
    }
    Capture(ShadowSetIndex(depth), shadow_.rays);
    AddToSamples();
    NextLevel(chunks);
  }

  void CountWave(uint32_t depth, size_t chunks) {
    if (result_.waves.size() <= depth) result_.waves.resize(depth + size_t{1});
    WaveCounts& wave = result_.waves[depth];
    wave.rays += level_.paths.size();
    for (size_t chunk = 0; chunk < chunks; ++chunk) {
      wave.hits += outputs_[chunk].hits[kReflection] + outputs_[chunk].hits[kRefraction];
      wave.shadow += outputs_[chunk].shadow.rays.size();
      wave.blocked += outputs_[chunk].blocked;
    }
  }

  void Shade(const World& met, bool last) {
    colors_.resize(level_.paths.size());
    workers_.ForChunks(level_.paths.size(), [&](size_t chunk, size_t begin, size_t end) {
      ShadeOutput& out = outputs_[chunk];
      out.Clear();
      for (size_t i = begin; i < end; ++i) {
        const Path& path = level_.paths[i];
        const rb_ray& ray = level_.batches[path.kind].rays[path.ray];
        const rb_hit& hit = hits_[path.kind][path.ray];
        const bool is_hit = IsHit(met.scene, met.tree, hit);
        out.hits[path.kind] += is_hit;
        colors_[i] = is_hit ? met.shader.Shade(path, uint32_t(i), ray, hit, last, out)
                            : path.weight * first_.shader.Background(ray);
      }
      if (!rest_.shader.gathers()) AddUnblocked(out);
    });
  }

  /// Asks for blockers of a chunk's shadow rays, while caches hold them, and adds what is lit.
  void AddUnblocked(ShadeOutput& out) {
    const size_t n = out.shadow.rays.size();
    out.occluded.resize(n);
    if (options_.shadows == ShadowQuery::kAny) {
      rb_query query = MakeQuery(RB_ANY, out.shadow);
      query.occluded = out.occluded.data();
      rest_.tree.Query(query);
    } else {
      out.blockers.resize(n);
      rb_query query = MakeQuery(RB_CLOSEST, out.shadow);
      query.hits = out.blockers.data();
      rest_.tree.Query(query);
      for (size_t i = 0; i < n; ++i) out.occluded[i] = out.blockers[i].prim != RAYBENCH_NONE;
    }
    for (size_t i = 0; i < out.lit.size(); ++i) {
      const auto& [color, path] = out.lit[i];
      if (out.occluded[i]) {
        ++out.blocked;
      } else {
        colors_[path] = colors_[path] + color;
      }
    }
  }

  /// Finds what each shadow ray lets through of its light, and adds that.
  void GatherLight(size_t chunks) {
    FindHits(workers_, rest_.tree, shadow_, shadow_hits_);
    visible_.assign(shadow_.rays.size(), Vec3f{1, 1, 1});
    result_.shadow_resumed += rest_.walk.Run(shadow_, shadow_hits_, [&](size_t i, const rb_hit& hit) {
      visible_[i] = visible_[i] * rest_.shader.Transmittance(hit);
      return !IsBlack(visible_[i]);
    });
    size_t ray = 0;
    for (size_t chunk = 0; chunk < chunks; ++chunk)
      for (const auto& [color, path] : outputs_[chunk].lit) {
        const Vec3f visible = visible_[ray++];
        if (IsBlack(visible)) {
          ++result_.shadow_blocked;
        } else {
          colors_[path] = colors_[path] + color * visible;
        }
      }
  }

  /// A sample belongs to the chunk in which its first path stands.
  void AddToSamples() {
    const std::vector<Path>& paths = level_.paths;
    auto starts_sample = [&](size_t i) { return i == 0 || paths[i].sample != paths[i - 1].sample; };
    workers_.ForChunks(paths.size(), [&](size_t, size_t begin, size_t end) {
      while (begin < end && !starts_sample(begin)) ++begin;
      for (size_t i = begin; begin < end && i < paths.size() && (i < end || !starts_sample(i)); ++i) {
        Vec3f& sample = samples_[paths[i].sample];
        sample = sample + colors_[i];
      }
    });
  }

  void NextLevel(size_t chunks) {
    std::array<std::vector<size_t>, kRayKinds> base;
    for (uint32_t kind = 0; kind < kRayKinds; ++kind) {
      base[kind].assign(chunks + 1, 0);
      for (size_t i = 0; i < chunks; ++i)
        base[kind][i + 1] = base[kind][i] + outputs_[i].next.batches[kind].rays.size();
      if (base[kind][chunks] > 0x7FFFFFFFu)
        throw InputError("more than 2^31 rays in a batch: trace with smaller bands or less depth");
      ConcatenateBatches(
          workers_, chunks,
          level_.batches[kind], [&](size_t i) -> auto& { return outputs_[i].next.batches[kind]; });
    }
    Concatenate(
        workers_, chunks, level_.paths, [&](size_t i) -> auto& { return outputs_[i].next.paths; },
        [&](size_t chunk, const std::vector<Path>& from, Path* to) {
          for (Path path : from) {
            path.ray = (path.ray + uint32_t(base[path.kind][chunk])) & 0x7FFFFFFFu;
            *to++ = path;
          }
        });
  }

  const TraceOptions& options_;
  const Sampling& sampling_;
  const TiledCells cells_;
  const CameraRays camera_;
  const uint32_t max_depth_;
  Workers workers_;
  const uint32_t band_;  // so many samples that all threads have work, and so few that caches hold it
  World first_;          // what camera rays meet
  std::optional<World> coarse_;
  World& rest_;  // what all others meet
  Film film_;
  TraceResult result_;

  // Buffers, reused from level to level.
  Level level_;
  std::array<std::vector<rb_hit>, kRayKinds> hits_;
  std::vector<ShadeOutput> outputs_;
  std::vector<Vec3f> colors_;   // per path
  std::vector<Vec3f> samples_;  // per sample of the band
  Batch shadow_;
  std::vector<rb_hit> shadow_hits_;
  std::vector<Vec3f> visible_;
};

void CheckPictureSize(uint64_t width, uint64_t height) {
  constexpr uint64_t kMost = 0xFFFFFFFFu;
  if (width == 0 || height == 0 || width > kMost || height > kMost / width)
    throw InputError("picture of " + std::to_string(width) + " x " + std::to_string(height) +
                     " pixels: width and height must be at least 1, their product below 2^32");
}

}  // namespace

TraceResult Trace(const Scene& scene, const Tree& tree, const TraceOptions& options,
                  const SecondaryScene* secondary) {
  CheckPictureSize(options.width, options.height);
  if (options.band_rays == 0 || options.band_rays > 0x7FFFFFFFu)
    throw InputError("band_rays = " + std::to_string(options.band_rays) + ": must lie in [1, 2^31)");
  CheckSampling(options.sampling);
  if (options.sampling.pattern == SamplePattern::kCorners)
    CheckPictureSize(uint64_t{options.width} + 1, uint64_t{options.height} + 1);
  const auto check = [](const char* name, float value) {
    if (!(value >= 0) || !std::isfinite(value))
      throw InputError(std::string(name) + " = " + std::to_string(value) + ": must be finite and at least 0");
  };
  check("self_intersection_size", options.self_intersection_size);
  check("min_contribution", options.min_contribution);
  if (secondary != nullptr && secondary->scene.scale_exponent != scene.scale_exponent)
    throw InputError(
        "the secondary scene '" + secondary->scene.name +
        "' is so much larger or smaller that its coordinates are scaled by another power of two");
  return Wavefront(scene, tree, options, secondary).Run();
}

void TakeLights(const Scene& scene, Scene& secondary) {
  secondary.lights = scene.lights;
  secondary.ambient = scene.ambient;
  secondary.environment = -1;  // rays that miss look up the scene's own
}

void PixelRays(const Scene& scene, uint32_t width, uint32_t height, uint64_t first, std::span<rb_ray> rays,
               uint32_t threads) {
  CheckPictureSize(width, height);
  if (first + rays.size() > uint64_t{width} * height)
    throw std::out_of_range("camera rays beyond the last pixel");
  const CameraRays camera(scene, width, height);
  Workers(threads).ForChunks(rays.size(), [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      rays[i] = camera.Through(double((first + i) % width) + 0.5, double((first + i) / width) + 0.5);
  });
}

void QueryParallel(const Tree& tree, const rb_query& query, uint32_t threads) {
  Workers workers(threads);
  QueryChunks(workers, tree, query);
}

}  // namespace raybench
