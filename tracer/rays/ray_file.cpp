#include "tracer/rays/ray_file.h"

#include <fmt/format.h>

#include <cstring>
#include <fstream>

#include "accel/base/files.h"
#include "accel/base/hash.h"
#include "accel/host/registry.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

constexpr char kMagic[8] = {'\x89', 'R', 'A', 'Y', 'S', '\r', '\n', '\x1a'};
constexpr uint32_t kVersion = 1;
constexpr uint64_t kMaxRays = 0xFFFFFFFF;

/// The first bytes of a file, little-endian.
struct RawHeader {
  char magic[8];
  uint32_t version, header_size;
  uint64_t count;
  uint32_t query, depth;
  uint64_t scene_hash, rays_hash;
  char kind[32], order[16], software[48], scene[104];
  uint64_t header_hash;  // Hash64 over everything before it
};
static_assert(sizeof(RawHeader) == 256 && offsetof(RawHeader, header_hash) == 248);
static_assert(sizeof(rb_ray) == 32);

uint64_t HashOf(const void* data, size_t size) {
  Hash64 hash;
  hash.Add(data, size);
  return hash.value();
}

std::string Hex(uint64_t value) { return fmt::format("{:016x}", value); }

[[noreturn]] void Fail(const fs::path& path, const std::string& what) {
  throw InputError(fmt::format("{}: {}", path.string(), what));
}

/// Without control characters, which neither a file's field nor a terminal should get.
std::string Printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  return text;
}

template <size_t kSize>
void Put(char (&field)[kSize], const std::string& text) {
  const std::string printable = Printable(text);
  std::memcpy(field, printable.data(), std::min(printable.size(), kSize - 1));
}

template <size_t kSize>
std::string Get(const char (&field)[kSize]) {
  return Printable(std::string(field, strnlen(field, kSize)));
}

bool IsKind(const std::string& kind) {
  return !kind.empty() && kind.size() < sizeof RawHeader::kind &&
         kind.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos;
}

bool IsOrder(const std::string& order) {
  return order == "traced" || order == "shuffled" || order == "recorded";
}

/// Origin and direction times 2^exponent; false if a bit was lost.
bool Scale(rb_ray& ray, int exponent) {
  for (float* vector : {ray.org, ray.dir}) {
    for (int i = 0; i < 3; ++i) {
      const float scaled = std::ldexp(vector[i], exponent);
      if (std::ldexp(scaled, -exponent) != vector[i]) return false;
      vector[i] = scaled;
    }
  }
  return true;
}

std::ifstream Open(const fs::path& path, uint64_t& size) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) Fail(path, "there is no such file");
  if (fs::is_directory(status)) Fail(path, "is a directory, not a .rays file");
  if (!fs::is_regular_file(status)) Fail(path, "is not a regular file");
  size = fs::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) Fail(path, "cannot be read");
  return in;
}

RayFileHeader ReadHeader(const fs::path& path, std::istream& in, uint64_t size) {
  RawHeader raw = {};
  in.read(reinterpret_cast<char*>(&raw), sizeof raw);
  const auto got = uint64_t(in.gcount());
  if (got < sizeof kMagic || std::memcmp(raw.magic, kMagic, sizeof kMagic) != 0)
    Fail(path, size == 0 ? "is empty, not a .rays file" : "is not a .rays file: it does not begin like one");
  if (got < sizeof raw) Fail(path, fmt::format("ends after {} of the header's {} bytes", got, sizeof raw));
  if (raw.version != kVersion)
    Fail(path, fmt::format("is a .rays file of version {}; version {} is read", raw.version, kVersion));
  const uint64_t header_hash = HashOf(&raw, offsetof(RawHeader, header_hash));
  if (header_hash != raw.header_hash)
    Fail(path, fmt::format("is damaged: the header's checksum is {}, but it says {}", Hex(header_hash),
                           Hex(raw.header_hash)));
  if (raw.header_size != sizeof raw)
    Fail(path, fmt::format("says that its header has {} bytes; version {} has {}", raw.header_size, kVersion,
                           sizeof raw));
  if (raw.count < 1 || raw.count > kMaxRays)
    Fail(path, fmt::format("says that it holds {} rays; 1 to {} are allowed", raw.count, kMaxRays));
  if (const uint64_t needed = sizeof raw + raw.count * sizeof(rb_ray); size != needed)
    Fail(path,
         fmt::format("{}: {} rays take {} bytes, it has {}",
                     size < needed ? "is truncated" : "goes on after its rays", raw.count, needed, size));
  if (raw.query != RB_CLOSEST && raw.query != RB_ANY)
    Fail(path, fmt::format("has query {}; allowed are {} (closest) and {} (any)", raw.query, int{RB_CLOSEST},
                           int{RB_ANY}));
  RayFileHeader header;
  header.count = raw.count;
  header.query = raw.query;
  header.depth = raw.depth;
  header.kind = Get(raw.kind);
  header.order = Get(raw.order);
  header.scene_hash = Hex(raw.scene_hash);
  header.rays_hash = Hex(raw.rays_hash);
  header.software = Get(raw.software);
  header.scene = Get(raw.scene);
  if (!IsKind(header.kind))
    Fail(path, fmt::format("has kind '{}'; 1 to 31 of a-z, 0-9 and _ are allowed", header.kind));
  if (!IsOrder(header.order))
    Fail(path, fmt::format("has order '{}'; allowed are traced, shuffled, recorded", header.order));
  return header;
}

}  // namespace

void WriteRayFile(const fs::path& path, const RaySet& set, const Scene& scene, const std::string& software) {
  if (set.rays.empty() || set.rays.size() > kMaxRays)
    Fail(path, fmt::format("a .rays file holds 1 to {} rays, not {}", kMaxRays, set.rays.size()));
  if (!IsKind(set.kind) || !IsOrder(set.order))
    Fail(path, fmt::format("kind '{}' or order '{}' is not allowed in a .rays file", set.kind, set.order));
  std::vector<rb_ray> scaled;
  if (scene.scale_exponent != 0) {
    scaled = set.rays;
    for (size_t i = 0; i < scaled.size(); ++i)
      if (!Scale(scaled[i], -scene.scale_exponent))
        Fail(path, fmt::format("ray {} cannot be brought back to the scene's own scale without loss", i));
  }
  const std::vector<rb_ray>& rays = scaled.empty() ? set.rays : scaled;

  RawHeader raw = {};
  std::memcpy(raw.magic, kMagic, sizeof kMagic);
  raw.version = kVersion;
  raw.header_size = sizeof raw;
  raw.count = rays.size();
  raw.query = set.query;
  raw.depth = set.depth;
  raw.scene_hash = std::stoull(scene.hash(), nullptr, 16);
  raw.rays_hash = HashOf(rays.data(), rays.size() * sizeof(rb_ray));
  Put(raw.kind, set.kind);
  Put(raw.order, set.order);
  Put(raw.software, software);
  Put(raw.scene, scene.name);
  raw.header_hash = HashOf(&raw, offsetof(RawHeader, header_hash));

  WriteFileAtomically(path, {{reinterpret_cast<const char*>(&raw), sizeof raw},
                             {reinterpret_cast<const char*>(rays.data()), rays.size() * sizeof(rb_ray)}});
}

bool HasFileForm(rb_ray ray, const Scene& scene) { return Scale(ray, -scene.scale_exponent); }

RayFileHeader ReadRayFileHeader(const fs::path& path) {
  uint64_t size = 0;
  std::ifstream in = Open(path, size);
  return ReadHeader(path, in, size);
}

RayFile ReadRayFile(const fs::path& path) {
  uint64_t size = 0;
  std::ifstream in = Open(path, size);
  RayFile file{path, ReadHeader(path, in, size), {}};
  file.rays.resize(file.header.count);
  const size_t bytes = file.rays.size() * sizeof(rb_ray);
  in.read(reinterpret_cast<char*>(file.rays.data()), std::streamsize(bytes));
  if (uint64_t(in.gcount()) != bytes) Fail(path, "cannot be read to its end");
  if (const std::string hash = Hex(HashOf(file.rays.data(), bytes)); hash != file.header.rays_hash)
    Fail(path, fmt::format("is damaged: the rays' checksum is {}, but the header says {}", hash,
                           file.header.rays_hash));
  return file;
}

RaySet ReplayedSet(const RayFile& file, const Scene& scene) {
  const RayFileHeader& header = file.header;
  if (header.scene_hash != scene.hash())
    Fail(file.path, fmt::format("was recorded in '{}' (hash {}), not in '{}' (hash {})", header.scene,
                                header.scene_hash, scene.name, scene.hash()));
  RaySet set{.kind = header.kind,
             .depth = header.depth,
             .order = header.order,
             .query = header.query,
             .rays = file.rays,
             .hash = {}};
  if (scene.scale_exponent != 0) {
    for (size_t i = 0; i < set.rays.size(); ++i) {
      rb_ray& ray = set.rays[i];
      if (!IsValidRay(ray)) {
        ray = InvalidRayStandIn();
      } else if (!Scale(ray, scene.scale_exponent)) {
        Fail(file.path, fmt::format("ray {} cannot be rescaled by 2^{}, as the scene was, without loss", i,
                                    scene.scale_exponent));
      }
    }
  }
  Freeze(set, scene.bounds());
  return set;
}

}  // namespace raybench
