// Wavefront OBJ.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>

#include "datasets/readers/mtl.h"
#include "datasets/readers/obj_corners.h"
#include "datasets/readers/readers.h"
#include "datasets/readers/text_reader.h"

namespace raybench {
namespace {

class ObjReader : MeshReader {
 public:
  ObjReader(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : MeshReader(path, ReadText(path), options, scene) {}

  /// Returns texture coordinates and normals of all faces; the file's text goes.
  ObjCorners Run() && {
    JoinContinuedLines();
    CountItems();
    Words words("");
    for (std::string_view key; NextStatement(key, words);) {
      Statement(key, words);
      TellProgress(lines_.offset());
    }
    if (sink_.faces() == 0)
      Fail(left_out_.empty() ? "has no faces; is it a Wavefront OBJ file?"
                             : fmt::format("has no faces (left out: {})", left_out_.Text()));
    if (!left_out_.empty()) NoteLeftOut(left_out_.Text());
    sink_.Close();
    return std::move(looks_);
  }

 private:
  std::string Where() const override {
    const auto joined = std::lower_bound(joined_.begin(), joined_.end(), lines_.offset()) - joined_.begin();
    return fmt::format("line {}", lines_.number() + uint64_t(joined));
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

  /// First, since an index may refer to a vertex further down.
  void CountItems() {
    uint64_t vertices = 0, faces = 0;
    std::string_view line;
    for (Lines lines(text_); lines.Next(line);) {
      const std::string_view key = Words(line).Next();
      vertices += key == "v";
      faces += IsFace(key);
    }
    if (int64_t(vertices) > kMaxCount)
      Fail(fmt::format("has {} vertices; {} are allowed", vertices, kMaxCount));
    Expect(vertices, faces);
  }

  static bool IsFace(std::string_view key) { return key == "f" || key == "fo"; }  // "fo" before 1995

  void Statement(std::string_view key, Words& words) {
    if (key == "v") {
      AddVertex(words, "3 are needed");
    } else if (IsFace(key)) {
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
      material_ = MaterialIndex(words.Rest());
    } else if (!IsGrouping(key)) {
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
      ReadMtl(path_.parent_path() / name, options_, scene_, library_);
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
    corners_.clear();
    corner_looks_.clear();
    bool has_looks = false;
    for (std::string_view word = words.Next(); !word.empty() && !word.starts_with('#'); word = words.Next()) {
      int64_t index = 0;
      if (!ParseInt(word.substr(0, word.find('/')), index) ||
          word.find_first_not_of("+-0123456789/") != word.npos)
        FailHere(fmt::format("face {} has the corner {}; an index such as 3 or 3/1/2 is needed",
                             sink_.faces(), Quoted(word)));
      const size_t vertices = scene_.positions.size();  // so far
      corners_.push_back(Corner(index, index < 0 ? int64_t(vertices) + index : index - 1, [&] {
        return fmt::format("1 to {}, or -{} to -1", sink_.vertices(), vertices);
      }));
      corner_looks_.push_back(CornerLooks(corners_.back(), word));
      has_looks = has_looks || corner_looks_.back().uv != RAYBENCH_NONE ||
                  corner_looks_.back().normal != RAYBENCH_NONE;
    }
    // Faces of two corners are common and harmless, but not at the end of a file cut off within a line.
    if (corners_.empty() || (corners_.size() < 3 && lines_.is_unended()))
      FailHere(fmt::format("face {} has {} corners; at least 3 are needed", sink_.faces(), corners_.size()));
    if (has_looks && corners_.size() >= 3) looks_.AddFace(uint32_t(sink_.faces()), corner_looks_);
    AddFace(corners_, material_);
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

  std::vector<size_t> joined_;  ///< where line breaks were that do not count
  uint32_t material_ = 0;
  std::vector<uint32_t> corners_;
  std::vector<ObjCorner> corner_looks_;
  ObjCorners looks_;
  MtlLibrary library_;
  Counts left_out_;
  std::map<MtlMap, int32_t> textures_;
  std::map<std::string, uint32_t, std::less<>> index_;
};

Scene ReadObj(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  scene.materials.emplace_back().name = "default";
  ObjCorners looks = ObjReader(path, options, scene).Run();
  scene.TakeHash();  // before vertices become several for their looks
  looks.Apply(scene, options.keep_unread);
  return scene;
}

}  // namespace

const Format kObj = {".obj", ReadObj};

}  // namespace raybench
