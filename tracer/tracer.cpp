// How a picture is made. Camera rays are walked in bands. Within a band, everything at one depth is done in
// batches:
//
//   paths of depth d --closest hits--> shading --shadow rays--> any hits --> colours --> pixels
//                                        \--reflected and refracted rays--> paths of depth d + 1
//
// Paths stand in the order of their pixels (tiles of 8 x 8), those of one pixel side by side; each batch is a
// subsequence of them. Work is cut into chunks of fixed size whose outputs are concatenated in order, and
// each pixel is summed up in the order of its paths: so pictures and ray sets depend neither on the thread
// count nor on the size of bands.
#include "tracer/tracer.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "tracer/surface.h"

namespace raybench {
namespace {

constexpr size_t kChunk = 4096;  // rays of a task
constexpr uint32_t kTile = 8;    // pixels
constexpr float kShadowFar =
    1 - 0x1p-20f;  // t of the light is 1 up to rounding: what carries the light is no blocker
constexpr float kInfinity = std::numeric_limits<float>::infinity();

class Workers {
 public:
  explicit Workers(uint32_t threads) {
    // Asking for more than oneTBB may start would only make it complain.
    const size_t most = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
    arena_.initialize(int(threads == 0 ? most : std::min<size_t>(threads, most)));
  }

  /// Calls work(chunk, begin, end) for every chunk of [0, n), in parallel.
  template <class Work>
  void ForChunks(size_t n, const Work& work) {
    arena_.execute([&] {
      tbb::parallel_for(size_t{0}, ChunkCount(n), [&](size_t chunk) {
        work(chunk, chunk * kChunk, std::min(n, (chunk + 1) * kChunk));
      });
    });
  }
  template <class Work>
  void ForEach(size_t n, const Work& work) {
    arena_.execute([&] { tbb::parallel_for(size_t{0}, n, work); });
  }
  static size_t ChunkCount(size_t n) { return (n + kChunk - 1) / kChunk; }

 private:
  tbb::task_arena arena_;
};

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

rb_query MakeQuery(uint32_t kind, const std::vector<rb_ray>& rays) {
  rb_query query{};
  query.struct_size = sizeof query;
  query.kind = kind;
  query.n = rays.size();
  query.rays = rays.data();
  return query;
}

void FindHits(Workers& workers, const Tree& tree, const std::vector<rb_ray>& rays,
              std::vector<rb_hit>& hits) {
  hits.resize(rays.size());
  rb_query query = MakeQuery(RB_CLOSEST, rays);
  query.hits = hits.data();
  QueryChunks(workers, tree, query);
}

/// False on a miss. Throws if the structure names a primitive that does not exist.
bool IsHit(const Scene& scene, const Tree& tree, const rb_hit& hit) {
  if (hit.prim == RAYBENCH_NONE) return false;
  if (hit.prim >= scene.primitive_count())
    throw std::runtime_error(std::string("structure ") + tree.structure().name + " answered with primitive " +
                             std::to_string(hit.prim) + " of " + std::to_string(scene.primitive_count()));
  return true;
}

/// Invalid rays (overflow, a light at the hit point) become the stand-in that Freeze() counts.
rb_ray MakeRay(Vec3f org, Vec3f dir, float tfar) {
  const rb_ray ray{{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, tfar};
  return IsValidRay(ray) ? ray : InvalidRayStandIn();
}

/// Camera rays by pixel, and pixels by slot: position in the order of tiles.
class PictureRays {
 public:
  PictureRays(const Scene& scene, uint32_t width, uint32_t height) : width_(width), height_(height) {
    const Camera& camera = scene.cameras.front();
    const Vec3d forward = ToDouble(camera.at) - ToDouble(camera.eye),
                right = Cross(forward, ToDouble(camera.up));
    eye_ = camera.eye;
    forward_ = Normalize(forward);
    right_ = Normalize(right);
    up_ = Cross(right_, forward_);
    tan_y_ = camera.tan_half_fov;
    tan_x_ = tan_y_ * width / height;
  }

  uint32_t Pixel(uint64_t slot) const {
    const uint64_t row_rays = uint64_t{kTile} * width_;
    const uint32_t y0 = uint32_t(slot / row_rays) * kTile;
    const uint32_t rest = uint32_t(slot % row_rays), tile_height = std::min(kTile, height_ - y0);
    const uint32_t x0 = rest / (kTile * tile_height) * kTile, in_tile = rest % (kTile * tile_height);
    const uint32_t tile_width = std::min(kTile, width_ - x0);
    return (y0 + in_tile / tile_width) * width_ + x0 + in_tile % tile_width;
  }

  rb_ray Ray(uint32_t pixel) const {
    const double x = (2 * (pixel % width_ + 0.5) / width_ - 1) * tan_x_;
    const double y = (1 - 2 * (pixel / width_ + 0.5) / height_) * tan_y_;
    return MakeRay(eye_, ToFloat(Normalize(forward_ + right_ * x + up_ * y)), kInfinity);
  }

 private:
  uint32_t width_, height_;
  Vec3f eye_;
  Vec3d forward_, right_, up_;
  double tan_x_, tan_y_;
};

/// The batch a path's ray stands in. At depth 0 camera rays take the place of reflected ones.
enum RayKind : uint32_t { kReflection, kRefraction, kRayKinds };

struct Path {
  Vec3f weight;
  uint32_t pixel;
  uint32_t kind : 1, ray : 31;  ///< RayKind, and place in that batch
};

/// All paths of one depth.
struct Level {
  std::vector<Path> paths;
  std::array<std::vector<rb_ray>, kRayKinds> rays;

  void Clear() {
    paths.clear();
    for (auto& batch : rays) batch.clear();
  }
  void Push(RayKind kind, Vec3f weight, uint32_t pixel, const rb_ray& ray) {
    paths.push_back({weight, pixel, kind, uint32_t(rays[kind].size()) & 0x7FFFFFFFu});
    rays[kind].push_back(ray);
  }
};

/// What a path gains if nothing stands between its hit and a light.
struct Lit {
  Vec3f color;
  uint32_t path;
};

struct ChunkOutput {
  Level next;
  std::vector<rb_ray> shadow;
  std::vector<Lit> lit;
};

/// Fills `all` with the parts, in order. `part(i)` is the i-th vector, `copy(i, from, to)` copies with
/// fix-ups.
template <class T, class Part, class Copy>
void Concatenate(Workers& workers, size_t count, std::vector<T>& all, const Part& part, const Copy& copy) {
  std::vector<size_t> begin(count + 1, 0);
  for (size_t i = 0; i < count; ++i) begin[i + 1] = begin[i] + part(i).size();
  all.resize(begin[count]);
  workers.ForEach(count, [&](size_t i) { copy(i, part(i), all.data() + begin[i]); });
}

template <class T, class Part>
void Concatenate(Workers& workers, size_t count, std::vector<T>& all, const Part& part) {
  Concatenate(workers, count, all, part,
              [](size_t, const std::vector<T>& from, T* to) { std::copy(from.begin(), from.end(), to); });
}

bool IsBlack(Vec3f color) { return color == Vec3f{0, 0, 0}; }

/// Shading (Whitted 1980): ambient and emission, Lambert and Phong for every light in front of the surface,
/// an ideal mirror ray, a refracted ray by Snell's law. Both sides are shaded alike. No path is cut off for
/// its low weight.
class Shader {
 public:
  Shader(const Scene& scene, bool last) : scene_(scene), last_(last) {}

  /// Returns the path's colour without lights; adds shadow rays and the next paths to `out`.
  Vec3f Shade(const Path& path, uint32_t path_index, const rb_ray& ray, const rb_hit& hit,
              ChunkOutput& out) const {
    const Material& material = scene_.materials[scene_.MaterialOf(hit.prim)];
    const SurfacePoint surface = SurfaceAt(scene_, ray, hit);
    const Vec3d view = Normalize(ToDouble(LoadVec3(ray.dir)));
    const bool leaving = Dot(surface.normal, view) > 0;  // along the geometric normal: out of the body
    const double side = leaving ? -1 : 1;
    const Vec3d normal = surface.normal * side;
    const double cos_view = -Dot(normal, view);
    const Vec3d mirrored = view + normal * (2 * cos_view);
    const Vec3f org = surface.Origin(side);

    for (const Light& light : scene_.lights) {
      const Vec3d to_light = ToDouble(light.position) - surface.point;
      const double square = Dot(to_light, to_light), cosine = Dot(normal, to_light) / std::sqrt(square);
      if (!(cosine > 0)) continue;
      Vec3f color = material.diffuse * float(cosine);
      if (!IsBlack(material.specular)) {
        const double phong = Dot(mirrored, to_light) / std::sqrt(square);
        if (phong > 0) color = color + material.specular * float(std::pow(phong, double(material.shininess)));
      }
      color = color * light.intensity * float(light.falloff ? 1 / square : 1);
      out.shadow.push_back(MakeRay(org, light.position - org, kShadowFar));
      out.lit.push_back({path.weight * color, path_index});
    }

    if (!last_) {
      Vec3f reflect = material.reflect;
      Vec3d refracted{};
      bool transmits = !IsBlack(material.transmit);
      if (transmits) {
        const double eta = leaving ? double(material.ior) : 1 / double(material.ior);
        const double cos_squared = 1 - eta * eta * (1 - cos_view * cos_view);
        if (cos_squared < 0) {  // total internal reflection: the mirror ray takes it all
          transmits = false;
          reflect = reflect + material.transmit;
        } else {
          refracted = view * eta + normal * (eta * cos_view - std::sqrt(cos_squared));
        }
      }
      if (!IsBlack(reflect))
        out.next.Push(kReflection, path.weight * reflect, path.pixel,
                      MakeRay(org, ToFloat(mirrored), kInfinity));
      if (transmits)
        out.next.Push(kRefraction, path.weight * material.transmit, path.pixel,
                      MakeRay(surface.Origin(-side), ToFloat(Normalize(refracted)), kInfinity));
    }
    return path.weight * (material.emission + scene_.ambient * material.diffuse);
  }

 private:
  const Scene& scene_;
  const bool last_;  // at the depth limit
};

class Wavefront {
 public:
  Wavefront(const Scene& scene, const Tree& tree, const TraceOptions& options)
      : scene_(scene),
        tree_(tree),
        options_(options),
        camera_(scene, options.width, options.height),
        workers_(options.threads) {
    result_.image = {options.width, options.height,
                     std::vector<Vec3f>(size_t{options.width} * options.height)};
  }

  TraceResult Run() {
    const uint64_t rays = result_.image.pixels.size(),
                   bands = (rays + options_.band_rays - 1) / options_.band_rays;
    for (uint64_t band = 0; band < bands; ++band) {
      StartBand(band * options_.band_rays, std::min<uint64_t>(rays, (band + 1) * options_.band_rays));
      for (uint32_t depth = 0; !level_.paths.empty(); ++depth) {
        TraceLevel(depth);
        if (options_.progress && depth < options_.max_depth)
          options_.progress((double(band) + (depth + 1.0) / (options_.max_depth + 1.0)) / double(bands));
      }
      if (options_.progress) options_.progress(double(band + 1) / double(bands));
    }
    std::erase_if(result_.ray_sets, [](const RaySet& set) { return set.rays.empty(); });
    for (RaySet& set : result_.ray_sets) Freeze(set, scene_.bounds());
    return std::move(result_);
  }

 private:
  void AddSetsOf(uint32_t depth) {
    if (depth == 0) AddSet("camera", depth, RB_CLOSEST);
    if (depth > 0) AddSet("reflection", depth, RB_CLOSEST), AddSet("refraction", depth, RB_CLOSEST);
    AddSet("shadow", depth, RB_ANY);
  }
  void AddSet(const char* kind, uint32_t depth, uint32_t query) {
    RaySet& set = result_.ray_sets.emplace_back();
    set.kind = kind, set.depth = depth, set.order = "traced", set.query = query;
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

  void StartBand(uint64_t begin, uint64_t end) {
    level_.Clear();
    level_.paths.resize(end - begin);
    level_.rays[kReflection].resize(end - begin);
    workers_.ForChunks(end - begin, [&](size_t, size_t from, size_t to) {
      for (size_t i = from; i < to; ++i) {
        const uint32_t pixel = camera_.Pixel(begin + i);
        level_.paths[i] = {{1, 1, 1}, pixel, kReflection, uint32_t(i) & 0x7FFFFFFFu};
        level_.rays[kReflection][i] = camera_.Ray(pixel);
      }
    });
  }

  void TraceLevel(uint32_t depth) {
    if (options_.capture && result_.ray_sets.size() <= ShadowSetIndex(depth)) AddSetsOf(depth);
    for (uint32_t kind = 0; kind < kRayKinds; ++kind)
      FindHits(workers_, tree_, level_.rays[kind], hits_[kind]);
    (depth == 0 ? result_.camera_rays : result_.reflection_rays) += level_.rays[kReflection].size();
    result_.refraction_rays += level_.rays[kRefraction].size();

    const size_t chunks = Workers::ChunkCount(level_.paths.size());
    if (outputs_.size() < chunks) outputs_.resize(chunks);
    Shade(Shader(scene_, depth >= options_.max_depth));
    for (uint32_t kind = 0; kind < kRayKinds; ++kind)
      Capture(SetIndex(depth, RayKind(kind)), level_.rays[kind]);
    TraceShadows(chunks);
    Capture(ShadowSetIndex(depth), shadow_rays_);
    AddToPixels();
    NextLevel(chunks);
  }

  void Shade(const Shader& shader) {
    colors_.resize(level_.paths.size());
    workers_.ForChunks(level_.paths.size(), [&](size_t chunk, size_t begin, size_t end) {
      ChunkOutput& out = outputs_[chunk];
      out.next.Clear(), out.shadow.clear(), out.lit.clear();
      for (size_t i = begin; i < end; ++i) {
        const Path& path = level_.paths[i];
        const rb_hit& hit = hits_[path.kind][path.ray];
        colors_[i] = IsHit(scene_, tree_, hit)
                         ? shader.Shade(path, uint32_t(i), level_.rays[path.kind][path.ray], hit, out)
                         : path.weight * scene_.background;
      }
    });
  }

  void TraceShadows(size_t chunks) {
    Concatenate(
        workers_, chunks, shadow_rays_, [&](size_t i) -> auto& { return outputs_[i].shadow; });
    result_.shadow_rays += shadow_rays_.size();
    occluded_.resize(shadow_rays_.size());
    rb_query query = MakeQuery(RB_ANY, shadow_rays_);
    query.occluded = occluded_.data();
    QueryChunks(workers_, tree_, query);

    std::vector<size_t> begin(chunks + 1, 0);
    for (size_t i = 0; i < chunks; ++i) begin[i + 1] = begin[i] + outputs_[i].lit.size();
    workers_.ForEach(chunks, [&](size_t chunk) {
      const uint8_t* occluded = occluded_.data() + begin[chunk];
      for (const Lit& lit : outputs_[chunk].lit)
        if (!*occluded++) colors_[lit.path] = colors_[lit.path] + lit.color;
    });
  }

  /// A pixel belongs to the chunk in which its first path stands.
  void AddToPixels() {
    const std::vector<Path>& paths = level_.paths;
    auto starts_pixel = [&](size_t i) { return i == 0 || paths[i].pixel != paths[i - 1].pixel; };
    workers_.ForChunks(paths.size(), [&](size_t, size_t begin, size_t end) {
      while (begin < end && !starts_pixel(begin)) ++begin;
      for (size_t i = begin; begin < end && i < paths.size() && (i < end || !starts_pixel(i)); ++i) {
        Vec3f& pixel = result_.image.pixels[paths[i].pixel];
        pixel = pixel + colors_[i];
      }
    });
  }

  void NextLevel(size_t chunks) {
    std::array<std::vector<size_t>, kRayKinds> base;
    for (uint32_t kind = 0; kind < kRayKinds; ++kind) {
      base[kind].assign(chunks + 1, 0);
      for (size_t i = 0; i < chunks; ++i)
        base[kind][i + 1] = base[kind][i] + outputs_[i].next.rays[kind].size();
      if (base[kind][chunks] > 0x7FFFFFFFu)
        throw InputError("more than 2^31 rays in a batch: trace with smaller bands or less depth");
      Concatenate(
          workers_, chunks,
          level_.rays[kind], [&](size_t i) -> auto& { return outputs_[i].next.rays[kind]; });
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

  const Scene& scene_;
  const Tree& tree_;
  const TraceOptions& options_;
  const PictureRays camera_;
  Workers workers_;
  TraceResult result_;

  // Buffers, reused from level to level.
  Level level_;
  std::array<std::vector<rb_hit>, kRayKinds> hits_;
  std::vector<ChunkOutput> outputs_;
  std::vector<Vec3f> colors_;  // per path
  std::vector<rb_ray> shadow_rays_;
  std::vector<uint8_t> occluded_;
};

void CheckPictureSize(uint32_t width, uint32_t height) {
  if (width == 0 || height == 0 || uint64_t{width} * height > 0xFFFFFFFFu)
    throw InputError("picture of " + std::to_string(width) + " x " + std::to_string(height) +
                     " pixels: width and height must be at least 1, their product below 2^32");
}

}  // namespace

TraceResult Trace(const Scene& scene, const Tree& tree, const TraceOptions& options) {
  CheckPictureSize(options.width, options.height);
  if (options.band_rays == 0 || options.band_rays > 0x7FFFFFFFu)
    throw InputError("band_rays = " + std::to_string(options.band_rays) + ": must lie in [1, 2^31)");
  return Wavefront(scene, tree, options).Run();
}

void PixelRays(const Scene& scene, uint32_t width, uint32_t height, uint64_t first, std::span<rb_ray> rays,
               uint32_t threads) {
  CheckPictureSize(width, height);
  if (first + rays.size() > uint64_t{width} * height)
    throw std::out_of_range("camera rays beyond the last pixel");
  const PictureRays camera(scene, width, height);
  Workers(threads).ForChunks(rays.size(), [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) rays[i] = camera.Ray(uint32_t(first + i));
  });
}

void QueryParallel(const Tree& tree, const rb_query& query, uint32_t threads) {
  Workers workers(threads);
  QueryChunks(workers, tree, query);
}

}  // namespace raybench
