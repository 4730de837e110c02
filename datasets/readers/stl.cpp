// STL, the stereolithography format (3D Systems 1989): ASCII, with any number of solids, and binary.
//
// The facets have corners, not indices. Corners at equal positions (0 and -0 are equal) become one vertex;
// the first one stands. Facet normals, the names of solids and the attribute bytes are skipped.

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <optional>

#include "datasets/readers/readers.h"
#include "datasets/readers/text_reader.h"
#include "datasets/scene/weld.h"

namespace raybench {
namespace {

constexpr size_t kHeaderSize = 84, kFacetSize = 50;
constexpr int64_t kMaxFacets = kMaxCount / 3;

class StlReader : TextReader {
 public:
  StlReader(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : TextReader(path, ReadFile(path), options, scene, 0.5) {}

  /// Fills `positions` with three corners a facet.
  void Run() {
    // "solid" begins many binary files too, so the size decides.
    const bool has_count = text_.size() >= kHeaderSize;
    const uint64_t count = has_count ? Uint32(80) : 0;
    if (has_count && text_.size() == kHeaderSize + kFacetSize * count) {
      ReadBinary(count);
    } else if (IsText()) {
      ReadAscii();
    } else if (has_count) {
      Fail(fmt::format(
          "is no STL file: as a binary one it says {} facets, which take {} bytes, but has {}; an "
          "ASCII one begins with 'solid' and has no zero bytes",
          count, kHeaderSize + kFacetSize * count, text_.size()));
    } else {
      Fail(fmt::format(
          "is no STL file: it begins with {}, not with 'solid', and its {} bytes are too few for a "
          "binary one",
          Quoted(PeekWord()), text_.size()));
    }
    if (scene_.stats.faces == 0) Fail("has no facets");
  }

 private:
  /// The facet ends here; its corners are the last three positions.
  void EndFacet() {
    if (int64_t(++scene_.stats.faces) > kMaxFacets) Fail(fmt::format("has more than {} facets", kMaxFacets));
  }

  // ---- binary ----

  uint32_t Uint32(size_t offset) const {
    uint32_t value = 0;
    for (int i = 3; i >= 0; --i) value = value << 8 | uint8_t(text_[offset + size_t(i)]);
    return value;
  }

  void ReadBinary(uint64_t count) {
    if (int64_t(count) > kMaxFacets) Fail(fmt::format("has {} facets; {} are allowed", count, kMaxFacets));
    scene_.positions.reserve(3 * count + 2);
    for (uint64_t i = 0; i < count; ++i) {
      size_t at = kHeaderSize + kFacetSize * i + 12;  // after the normal
      for (int corner = 0; corner < 3; ++corner) {
        Vec3f& p = scene_.positions.emplace_back();
        for (int k = 0; k < 3; ++k, at += 4) {
          p[k] = std::bit_cast<float>(Uint32(at));
          if (!std::isfinite(p[k]) && !options_.drop_bad)
            Fail(fmt::format("byte {}: facet {} has the corner coordinate {}; it must be finite{}", at, i,
                             p[k], kOrDropBad));
        }
      }
      EndFacet();
      TellProgress(at);
    }
  }

  // ---- ASCII ----

  /// Makes the text plain if it is one that begins as it should.
  bool IsText() {
    if (text_.starts_with("\xFF\xFE") || text_.starts_with("\xFE\xFF") || text_.find('\0') == text_.npos) {
      MakePlain(path_, text_);
      lines_ = Lines(text_);
    }
    return text_.find('\0') == text_.npos && IsKeyword(PeekWord(), "solid");
  }

  static bool IsKeyword(std::string_view word, std::string_view keyword) {
    return std::equal(word.begin(), word.end(), keyword.begin(), keyword.end(),
                      [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
  }

  std::string_view PeekWord() const {
    const size_t begin = std::min(text_.find_first_not_of(" \t\r\n\v\f"), text_.size());
    const size_t end = std::min(text_.find_first_of(" \t\r\n\v\f", begin), text_.size());
    return std::string_view(text_).substr(begin, end - begin);
  }

  void Expect(std::string_view keyword) {
    const std::string_view word = NextWord();
    if (IsKeyword(word, keyword)) return;
    if (word.empty()) FailEarly(fmt::format("'{}' of facet {}", keyword, scene_.stats.faces));
    FailHere(fmt::format("facet {} has {} where '{}' is needed", scene_.stats.faces, Quoted(word), keyword));
  }

  /// The name of a solid goes on to the end of the line; but where a whole file stands on one line, to what
  /// is no name: the first facet, "endsolid", and behind that the "solid" before these.
  void SkipName(bool has_ended) {
    std::optional<Words> solid;
    for (Words here = words_;; words_ = here) {
      const std::string_view word = here.Next();
      if (word.empty()) break;
      if (has_ended && !solid && IsKeyword(word, "solid")) solid = words_;
      if (IsKeyword(word, "endsolid") ||
          (IsKeyword(word, "facet") && IsKeyword(Words(here).Next(), "normal"))) {
        if (solid) words_ = *solid;
        return;
      }
    }
    words_ = Words("");
  }

  void ReadAscii() {
    bool is_open = false;
    for (std::string_view word = NextWord(); !word.empty(); word = NextWord()) {
      if (!is_open) {
        if (!IsKeyword(word, "solid"))
          FailHere(fmt::format("{} stands where 'solid' is needed", Quoted(word)));
        SkipName(false);
        is_open = true;
      } else if (IsEnd(word, "solid")) {
        SkipName(true);
        is_open = false;
      } else if (IsKeyword(word, "facet")) {
        ReadFacet();
      } else {
        FailHere(fmt::format("{} stands where 'facet' or 'endsolid' is needed", Quoted(word)));
      }
      TellProgress(lines_.offset());
    }
    if (is_open) FailEarly("'endsolid'");
  }

  void ReadFacet() {
    Expect("normal");
    for (int k = 0; k < 3; ++k) NextWord();
    Expect("outer");
    Expect("loop");
    for (int corner = 0; corner < 3; ++corner) {
      Expect("vertex");
      Vec3f& p = scene_.positions.emplace_back();
      for (int k = 0; k < 3; ++k)
        p[k] = Coordinate(NextWord(), "facet {} has the corner coordinate", scene_.stats.faces);
    }
    ExpectEnd("loop");
    ExpectEnd("facet");
    EndFacet();
  }

  /// "endloop", which some write as "end loop".
  bool IsEnd(std::string_view word, std::string_view of) {
    if (word.size() == of.size() + 3 && IsKeyword(word.substr(0, 3), "end") && IsKeyword(word.substr(3), of))
      return true;
    Words next = words_;
    if (!IsKeyword(word, "end") || !IsKeyword(next.Next(), of)) return false;
    words_ = next;
    return true;
  }
  void ExpectEnd(std::string_view of) {
    const std::string_view word = NextWord();
    if (IsEnd(word, of)) return;
    if (word.empty()) FailEarly(fmt::format("'end{}' of facet {}", of, scene_.stats.faces));
    FailHere(fmt::format("facet {} has {} where 'end{}' is needed", scene_.stats.faces, Quoted(word), of));
  }
};

/// Three vertices a facet, as the file has them: what hash() is of.
void NumberCorners(Scene& scene) {
  scene.triangles.resize(scene.positions.size() / 3);
  scene.triangle_face.resize(scene.triangles.size());
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    scene.triangles[i] = {3 * i, 3 * i + 1, 3 * i + 2};
    scene.triangle_face[i] = i;
  }
}

/// With drop_bad.
void DropBadFacets(Scene& scene) {
  size_t kept = 0;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    Vec3f* const corners = &scene.positions[3 * i];
    const bool is_finite = std::all_of(corners, corners + 3, [](Vec3f p) {
      return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    });
    if (!is_finite) continue;
    std::copy(corners, corners + 3, &scene.positions[3 * kept]);
    scene.triangle_face[kept++] = uint32_t(i);
  }
  scene.stats.dropped_triangles += scene.triangles.size() - kept;
  scene.positions.resize(3 * kept);
  scene.triangle_face.resize(kept);
}

/// Makes one vertex of equal corners, numbered by their first occurrence.
void IndexCorners(Scene& scene) {
  std::vector<uint32_t> same = WeldVertices(scene.positions);
  size_t count = 0;
  for (size_t i = 0; i < same.size(); ++i) count += same[i] == i;
  std::vector<Vec3f> vertices;
  vertices.reserve(count + 2);  // Finish() wants room for two more
  for (size_t i = 0; i < same.size(); ++i) {
    if (same[i] == i) {
      same[i] = uint32_t(vertices.size());
      vertices.push_back(scene.positions[i]);
    } else {
      same[i] = same[same[i]];  // the first of the equals has its number already
    }
  }
  scene.positions = std::move(vertices);
  scene.triangles.resize(same.size() / 3);
  for (size_t i = 0; i < scene.triangles.size(); ++i)
    scene.triangles[i] = {same[3 * i], same[3 * i + 1], same[3 * i + 2]};
}

Scene ReadStl(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  StlReader(path, options, scene).Run();
  if (options.progress) options.progress(0.6);
  NumberCorners(scene);
  scene.TakeHash();
  if (options.drop_bad) DropBadFacets(scene);
  IndexCorners(scene);
  scene.triangle_material.resize(scene.triangles.size());
  return scene;
}

}  // namespace

const Format kStl = {".stl", ReadStl};

}  // namespace raybench
