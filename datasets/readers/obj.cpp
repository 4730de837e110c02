// Wavefront OBJ. OpenMesh is given vertices and faces alone: of materials it passes on nothing but an 8-bit
// diffuse colour, and its texture coordinates and normals would be one a vertex.

#include <fmt/format.h>

#include <OpenMesh/Core/IO/reader/OBJReader.hh>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>

#include "datasets/readers/mesh_sink.h"
#include "datasets/readers/mtl.h"
#include "datasets/readers/obj_corners.h"
#include "datasets/readers/openmesh_importer.h"
#include "datasets/readers/readers.h"

namespace raybench {
namespace {

/// True if a number occurs twice.
bool HasRepeats(const std::vector<int64_t>& numbers, std::vector<int64_t>& scratch) {
  if (numbers.size() <= 8) {
    for (size_t i = 1; i < numbers.size(); ++i)
      for (size_t k = 0; k < i; ++k)
        if (numbers[i] == numbers[k]) return true;
    return false;
  }
  scratch = numbers;
  std::sort(scratch.begin(), scratch.end());
  return std::adjacent_find(scratch.begin(), scratch.end()) != scratch.end();
}

/// The strict pass over an OBJ file; adds its materials to the scene.
class ObjScan {
 public:
  ObjScan(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : path_(path),
        drop_bad_(options.drop_bad),
        scene_(scene),
        text_(ReadText(path)),
        stage_(options, 0, 0.4) {}

  CleanMesh Run() {
    JoinContinuedLines();
    // Count first, since an index may refer to a vertex further down.
    std::string_view line;
    for (Lines lines(text_); lines.Next(line);) vertex_count_ += Words(line).Next() == "v";
    if (int64_t(vertex_count_) > kMaxCount)
      Fail(fmt::format("has {} vertices; {} are allowed", vertex_count_, kMaxCount));
    mesh_.text.reserve(text_.size() + text_.size() / 16);
    while (lines_.Next(line)) {
      Line(Words(line));
      stage_.Tell(lines_.offset(), text_.size());
    }
    if (mesh_.faces == 0)
      Fail(left_out_.empty() ? "has no faces; is it a Wavefront OBJ file?"
                             : fmt::format("has no faces (left out: {})", left_out_.Text()));
    if (!left_out_.empty()) scene_.stats.notes.push_back("left out: " + left_out_.Text());
    text_ = {};
    return std::move(mesh_);
  }

  /// Of all faces so far.
  ObjCorners& corners() { return looks_; }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw InputError(path_.string() + ": " + what); }
  [[noreturn]] void FailLine(const std::string& what) const {
    const auto joined = std::lower_bound(joined_.begin(), joined_.end(), lines_.offset()) - joined_.begin();
    Fail(fmt::format("line {}: {}", lines_.number() + uint64_t(joined), what));
  }

  /// Puts blanks for a backslash and the line break after it, and notes where.
  void JoinContinuedLines() {
    for (size_t i = text_.find('\\'); i != text_.npos; i = text_.find('\\', i + 1)) {
      size_t end = i + 1 < text_.size() && text_[i + 1] == '\r' ? i + 2 : i + 1;
      if (end >= text_.size() || text_[end] != '\n') continue;
      text_.replace(i, end + 1 - i, end + 1 - i, ' ');
      joined_.push_back(end);
    }
  }

  void Line(Words words) {
    const std::string_view key = words.Next();
    if (key == "v") {
      Vertex(words);
    } else if (key == "f" || key == "fo") {  // its name before 1995
      Face(words);
    } else if (key == "vt") {
      float uv[2] = {0, 0};  // the second is optional
      ReadNumbers(words, uv);
      looks_.uvs.push_back({uv[0], 1 - uv[1]});  // v points up in OBJ
    } else if (key == "vn") {
      float n[3] = {0, 0, 0};
      ReadNumbers(words, n);
      looks_.normals.push_back({n[0], n[1], n[2]});
    } else if (key == "mtllib") {
      ReadLibrary(std::string(words.Rest()));
    } else if (key == "usemtl") {
      mesh_.materials.push_back({uint32_t(mesh_.faces), MaterialIndex(words.Rest())});
    } else if (!key.empty() && !key.starts_with('#') && !IsGrouping(key)) {
      left_out_.Add(key);
    }
  }

  /// Says nothing about geometry or looks.
  static bool IsGrouping(std::string_view key) {
    return key == "g" || key == "o" || key == "s" || key == "mg" || key == "lod" || key == "bevel" ||
           key == "c_interp" || key == "d_interp";
  }

  void ReadLibrary(const std::string& name) {
    try {
      ReadMtl(path_.parent_path() / name, library_, scene_.stats.notes);
    } catch (const InputError& e) {
      scene_.stats.notes.push_back(
          fmt::format("the material file {} cannot be read: {}", Quoted(name), OneLine(e.what())));
    }
  }

  /// What is no number becomes one that is not finite: Finish() counts and notes those.
  template <size_t N>
  static void ReadNumbers(Words& words, float (&out)[N]) {
    for (float& x : out) {
      const std::string_view word = words.Next();
      if (word.empty() || word.starts_with('#')) return;
      if (ParseNumber(word, x) == Number::kMalformed) x = std::numeric_limits<float>::quiet_NaN();
    }
  }

  void Vertex(Words& words) {
    std::string_view coordinates[3];
    Vec3f position;
    bool is_finite = true;
    for (int i = 0; i < 3; ++i) {
      const std::string_view word = coordinates[i] = words.Next();
      if (word.empty() || word.starts_with('#'))
        FailLine(fmt::format("vertex {} has {} coordinates; 3 are needed", mesh_.vertices, i));
      const Number number = ParseNumber(word, position[i]);
      is_finite &= number == Number::kFinite;
      CheckCoordinate(number, word, mesh_.vertices, drop_bad_,
                      [&](const std::string& what) { FailLine(what); });
    }
    if (!is_finite) mesh_.bad_vertices.push_back({uint32_t(mesh_.vertices), position});
    mesh_.text += 'v';
    for (std::string_view word : coordinates) (mesh_.text += ' ') += is_finite ? word : "0";
    mesh_.text += '\n';
    ++mesh_.vertices;
  }

  /// The second and third number of a corner such as 3/1/2.
  ObjCorner CornerLooks(uint32_t vertex, std::string_view word) const {
    const auto part = [&](size_t count) {
      word.remove_prefix(std::min(word.find('/'), word.size() - 1) + 1);
      int64_t index = 0;
      if (!ParseInt(word.substr(0, word.find('/')), index)) return RAYBENCH_NONE;
      if (index < 0) index += int64_t(count) + 1;
      return index >= 1 && index < kMaxCount ? uint32_t(index - 1)
                                             : uint32_t(kMaxCount);  // one that none has
    };
    const uint32_t uv = part(looks_.uvs.size()),
                   normal = word.empty() ? RAYBENCH_NONE : part(looks_.normals.size());
    return {vertex, uv, normal};
  }

  void Face(Words& words) {
    corners_.clear();  // counted from 1, as in the file
    corner_looks_.clear();
    bool is_bad = false, has_looks = false;
    for (std::string_view word = words.Next(); !word.empty() && !word.starts_with('#'); word = words.Next()) {
      int64_t index = 0;
      if (!ParseInt(word.substr(0, word.find('/')), index) ||
          word.find_first_not_of("+-0123456789/") != word.npos)
        FailLine(fmt::format("face {} has the corner {}; an index such as 3 or 3/1/2 is needed", mesh_.faces,
                             Quoted(word)));
      int64_t corner = index < 0 ? int64_t(mesh_.vertices) + index + 1 : index;
      if (corner < 1 || corner > int64_t(vertex_count_)) {
        if (!drop_bad_)
          FailLine(fmt::format("face {} refers to vertex {}; allowed are 1 to {}, or -{} to -1{}",
                               mesh_.faces, index, vertex_count_, mesh_.vertices, kOrDropBad));
        is_bad = true;
        corner = int64_t{RAYBENCH_NONE} + 1;
      }
      corners_.push_back(corner);
      corner_looks_.push_back(CornerLooks(uint32_t(corner - 1), word));
      has_looks = has_looks || corner_looks_.back().uv != RAYBENCH_NONE ||
                  corner_looks_.back().normal != RAYBENCH_NONE;
    }
    // Faces of two corners are common and harmless, but not at the end of a file cut off within a line.
    if (corners_.empty() || (corners_.size() < 3 && lines_.is_unended()))
      FailLine(fmt::format("face {} has {} corners; at least 3 are needed", mesh_.faces, corners_.size()));
    if (has_looks && corners_.size() >= 3) looks_.AddFace(uint32_t(mesh_.faces), corner_looks_);
    scene_.stats.degenerate_triangles += corners_.size() < 3;
    // OpenMesh would leave out without a word what has not 3 different corners, and any face with a corner
    // given twice, as what joins a hole to the outline has.
    if (is_bad || corners_.size() < 3 || HasRepeats(corners_, scratch_)) {
      CleanMesh::HeldBack& face = mesh_.held_back.emplace_back();
      face.face = uint32_t(mesh_.faces);
      for (int64_t corner : corners_) face.corners.push_back(uint32_t(corner - 1));
    } else {
      mesh_.text += 'f';
      for (int64_t corner : corners_) AddNumber(corner);
      mesh_.text += '\n';
    }
    if (int64_t(++mesh_.faces) > kMaxCount) Fail(fmt::format("has more than {} faces", kMaxCount));
  }

  void AddNumber(int64_t number) {
    char digits[24];
    mesh_.text += ' ';
    mesh_.text.append(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
  }

  uint32_t MaterialIndex(std::string_view name) {
    auto [it, is_new] = index_.try_emplace(std::string(name), uint32_t(scene_.materials.size()));
    const auto found = library_.find(name);
    if (found == library_.end())
      left_out_.Add(fmt::format("usemtl of the unknown material {}", Quoted(name)));
    if (is_new) {
      Material m;
      if (found != library_.end()) {
        m = found->second.material;
        m.base_color_texture = LoadTexture(found->second.diffuse);
        m.emission_texture = LoadTexture(found->second.emission);
        // Without its picture all of it would glow.
        if (m.emission_texture < 0 && !found->second.emission.file.empty()) m.emission = {0, 0, 0};
      }
      m.name = std::string(name);
      scene_.materials.push_back(m);
    }
    return it->second;
  }

  /// The scene's index of a picture; -1 for none, and, with a note, where its file cannot be read.
  int32_t LoadTexture(const MtlMap& map) {
    if (map.file.empty()) return -1;
    const auto [it, is_new] = textures_.try_emplace(map, -1);
    if (!is_new) return it->second;
    Texture texture;
    try {
      texture.bytes = std::make_shared<std::string>(ReadFile(map.file));
    } catch (const InputError& e) {
      scene_.stats.notes.push_back(fmt::format("a texture is not used: {}", OneLine(e.what())));
      return -1;
    }
    texture.name = map.file.filename().string();
    texture.source = map.file.string();
    texture.mime_type = ImageType(*texture.bytes);
    std::string ending = map.file.extension().string();
    for (char& c : ending) c = char(std::tolower(static_cast<unsigned char>(c)));
    if (texture.mime_type.empty() && ending == ".tga") texture.mime_type = "image/x-tga";  // has no mark
    texture.wrap_u = texture.wrap_v = map.wrap;
    scene_.textures.push_back(std::move(texture));
    return it->second = int32_t(scene_.textures.size() - 1);
  }

  const std::filesystem::path& path_;
  bool drop_bad_;
  Scene& scene_;
  std::string text_;
  LoadStage stage_;
  Lines lines_{text_};
  std::vector<size_t> joined_;  ///< where line breaks were that do not count
  CleanMesh mesh_;
  uint64_t vertex_count_ = 0;
  std::vector<int64_t> corners_, scratch_;
  std::vector<ObjCorner> corner_looks_;
  ObjCorners looks_;
  MtlLibrary library_;
  Counts left_out_;
  std::map<MtlMap, int32_t> textures_;
  std::map<std::string, uint32_t, std::less<>> index_;
};

}  // namespace

Scene ReadObj(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  scene.provenance.source = path.string();
  scene.materials.emplace_back().name = "default";
  ObjScan scan(path, options, scene);
  ReadWithOpenMesh(OpenMesh::IO::OBJReader(), path.string(), scan.Run(), options, scene);
  scene.TakeHash();  // before vertices become several for their looks
  scan.corners().Apply(scene, options.keep_unread);
  return scene;
}

}  // namespace raybench
