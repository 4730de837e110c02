// OBJ and OFF through OpenMesh's reader modules.
//
// The readers feed a custom importer, not a half-edge mesh: a half-edge mesh drops or duplicates what is not
// manifold, and so changes the number and the order of the faces. Here every face of the file keeps its id.
//
// OpenMesh's readers are lax: a vertex that does not parse ("nan") is skipped, which shifts all later
// indices; a face of repeated vertices is skipped; a truncated OFF repeats its last values; some input
// aborts. So a strict pass over the text comes first. It refuses what is wrong, naming the line, and hands
// OpenMesh the vertices and faces alone, without what it would misread (comments, colours after a face, a
// NaN). OBJ materials are read here as well, because OpenMesh passes on nothing of them but an 8-bit diffuse
// colour.

#include <fmt/format.h>

#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <OpenMesh/Core/IO/reader/OBJReader.hh>
#include <OpenMesh/Core/IO/reader/OFFReader.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <mutex>
#include <sstream>
#include <string_view>

#include "datasets/readers.h"

namespace raybench {

std::string ReadFile(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw InputError(path.string() + ": no such file");
  if (std::filesystem::is_directory(status)) throw InputError(path.string() + ": is a directory, not a file");
  std::ifstream in(path, std::ios::binary);
  if (!in) throw InputError(path.string() + ": cannot be opened for reading");
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (in.bad()) throw InputError(path.string() + ": cannot be read");
  if (text.empty()) throw InputError(path.string() + ": is empty");
  return text;
}

std::string OneLine(const std::string& text) {
  std::string line;
  for (char c : text) {
    if (c == '\n') {
      if (!line.empty() && line.back() != ' ') line += "; ";
    } else if (std::iscntrl(static_cast<unsigned char>(c)) || c == ' ') {
      if (!line.empty() && line.back() != ' ') line += ' ';
    } else {
      line += c;
    }
  }
  while (!line.empty() && (line.back() == ' ' || line.back() == ';')) line.pop_back();
  return line;
}

namespace {

constexpr int64_t kMaxCount = (1u << 31) - 1;  // OpenMesh's handles are ints

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// The blank-separated words of one line.
class Words {
 public:
  explicit Words(std::string_view line) : p_(line.data()), end_(line.data() + line.size()) {}
  /// The next word, empty at the end.
  std::string_view Next() {
    while (p_ < end_ && IsBlank(*p_)) ++p_;
    const char* begin = p_;
    while (p_ < end_ && !IsBlank(*p_)) ++p_;
    return {begin, size_t(p_ - begin)};
  }
  std::string_view Rest() {
    while (p_ < end_ && IsBlank(*p_)) ++p_;
    const char* end = end_;
    while (end > p_ && IsBlank(end[-1])) --end;
    return {p_, size_t(end - p_)};
  }

 private:
  const char *p_, *end_;
};

enum class Number { kFinite, kNotFinite, kMalformed };

/// kNotFinite: "nan", "inf", or beyond the range of float.
Number ParseNumber(std::string_view word, double& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || end != word.data() + word.size()) return Number::kMalformed;
  if (error == std::errc::result_out_of_range)
    value = std::strtod(std::string(word).c_str(), nullptr);  // 0 or inf
  else if (error != std::errc())
    return Number::kMalformed;
  return std::isfinite(float(value)) ? Number::kFinite : Number::kNotFinite;
}

bool ParseInt(std::string_view word, int64_t& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return !word.empty() && error == std::errc() && end == word.data() + word.size();
}

std::string Quoted(std::string_view text) { return OneLine(fmt::format("'{}'", text.substr(0, 40))); }

/// What the strict pass found out; OpenMesh's answers must agree with it.
struct Expected {
  std::string text;  ///< what OpenMesh reads
  uint64_t vertices = 0, faces = 0;
  std::vector<uint32_t> bad_vertices;   ///< not finite, kept only with drop_bad
  std::vector<uint32_t> call_face;      ///< file face of each add_face() call; empty: all faces in order
  std::vector<uint32_t> face_material;  ///< empty: 0

  /// OpenMesh gets 0 0 0 for a vertex that is not finite: it would skip it otherwise.
  void AddVertex(std::string_view key, const std::string_view (&coordinates)[3], bool finite,
                 uint64_t index) {
    text += key;
    for (std::string_view word : coordinates) {
      text += finite ? word : "0";
      text += ' ';
    }
    text += '\n';
    if (!finite) bad_vertices.push_back(uint32_t(index));
  }
  void AddNumber(int64_t number) {
    char digits[24];
    text += ' ';
    text.append(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
  }
};

/// Fails if the word is no number, or not finite unless `drop_bad`; then `finite` is cleared.
template <class Fail>
void CheckCoordinate(std::string_view word, uint64_t vertex, bool drop_bad, bool& finite, const Fail& fail) {
  double value;
  Number number = ParseNumber(word, value);
  if (number == Number::kMalformed)
    fail(fmt::format("vertex {} has the coordinate {}; a number is needed", vertex, Quoted(word)));
  if (number == Number::kNotFinite && !drop_bad)
    fail(fmt::format("vertex {} has the coordinate {}; it must be finite", vertex, Quoted(word)));
  finite &= number == Number::kFinite;
}

/// Collects what an OpenMesh reader tells into a scene.
class SceneImporter final : public OpenMesh::IO::BaseImporter {
 public:
  SceneImporter(Scene& scene, const Expected& expected, const LoadOptions& options, const std::string& path)
      : scene_(scene), expected_(expected), options_(options), path_(path) {
    scene_.positions.reserve(expected.vertices + 2);
    scene_.triangles.reserve(expected.faces);
    scene_.triangle_face.reserve(expected.faces);
    scene_.triangle_material.reserve(expected.faces);
  }

  OpenMesh::VertexHandle add_vertex(const OpenMesh::Vec3f& p) override {
    scene_.positions.push_back({p[0], p[1], p[2]});
    return OpenMesh::VertexHandle(int(scene_.positions.size() - 1));
  }
  OpenMesh::VertexHandle add_vertex() override { return add_vertex(OpenMesh::Vec3f(0, 0, 0)); }

  OpenMesh::FaceHandle add_face(const VHandles& corners) override {
    uint64_t face = expected_.call_face.empty()           ? calls_
                    : calls_ < expected_.call_face.size() ? expected_.call_face[calls_]
                                                          : expected_.faces;
    ++calls_;
    if (face >= expected_.faces) throw InputError(path_ + ": OpenMesh read more faces than the file has");
    uint32_t material = expected_.face_material.empty() ? 0 : expected_.face_material[face];
    for (size_t i = 2; i < corners.size(); ++i) {
      scene_.triangles.push_back(
          {uint32_t(corners[0].idx()), uint32_t(corners[i - 1].idx()), uint32_t(corners[i].idx())});
      scene_.triangle_face.push_back(uint32_t(face));
      scene_.triangle_material.push_back(material);
    }
    if (options_.progress && calls_ % 65536 == 0)
      options_.progress(0.3 + 0.7 * double(face) / double(expected_.faces));
    return OpenMesh::FaceHandle(int(calls_ - 1));
  }

  size_t n_vertices() const override { return scene_.positions.size(); }
  size_t n_faces() const override { return calls_; }
  size_t n_edges() const override { return 0; }

  // Not asked for and not needed.
  OpenMesh::HalfedgeHandle add_edge(OpenMesh::VertexHandle, OpenMesh::VertexHandle) override {
    return OpenMesh::HalfedgeHandle();
  }
  OpenMesh::FaceHandle add_face(OpenMesh::HalfedgeHandle) override { return OpenMesh::FaceHandle(); }
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle,
                          const std::vector<OpenMesh::Vec2f>&) override {}
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle,
                          const std::vector<OpenMesh::Vec3f>&) override {}
  void set_face_texindex(OpenMesh::FaceHandle, int) override {}
  void set_point(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_halfedge(OpenMesh::VertexHandle, OpenMesh::HalfedgeHandle) override {}
  void set_normal(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(OpenMesh::VertexHandle, const OpenMesh::Vec3d&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec4f&) override {}
  void set_texcoord(OpenMesh::VertexHandle, const OpenMesh::Vec2f&) override {}
  void set_status(OpenMesh::VertexHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_next(OpenMesh::HalfedgeHandle, OpenMesh::HalfedgeHandle) override {}
  void set_face(OpenMesh::HalfedgeHandle, OpenMesh::FaceHandle) override {}
  void request_face_texcoords2D() override {}
  void set_texcoord(OpenMesh::HalfedgeHandle, const OpenMesh::Vec2f&) override {}
  void set_texcoord(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_texcoord(OpenMesh::HalfedgeHandle, const OpenMesh::Vec3f&) override {}
  void set_status(OpenMesh::HalfedgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec4f&) override {}
  void set_status(OpenMesh::EdgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_normal(OpenMesh::FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(OpenMesh::FaceHandle, const OpenMesh::Vec3d&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec4f&) override {}
  void set_status(OpenMesh::FaceHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void add_texture_information(int, std::string) override {}

 private:
  Scene& scene_;
  const Expected& expected_;
  const LoadOptions& options_;
  const std::string& path_;
  uint64_t calls_ = 0;
};

/// While it lives, what OpenMesh would print goes into text().
class OpenMeshMessages {
 public:
  OpenMeshMessages() {
    omerr().disconnect(std::cerr);
    omerr().connect(text_);
  }
  ~OpenMeshMessages() {
    omerr().disconnect(text_);
    omerr().connect(std::cerr);
  }
  std::string text() const { return OneLine(text_.str()); }

 private:
  std::ostringstream text_;
};

/// Runs an OpenMesh reader over the prepared text and checks that it saw what the strict pass saw.
void ReadWithOpenMesh(OpenMesh::IO::BaseReader& reader, const std::string& path, Expected expected,
                      const LoadOptions& options, Scene& scene) {
  static std::mutex mutex;  // the reader modules are singletons with state
  std::lock_guard lock(mutex);
  OpenMeshMessages messages;
  SceneImporter importer(scene, expected, options, path);
  OpenMesh::IO::Options flags;
  flags.clear();
  std::istringstream in(std::move(expected.text));
  if (!reader.read(in, importer, flags))
    throw InputError(path + ": OpenMesh cannot read it: " + messages.text());
  uint64_t calls = expected.call_face.empty() ? expected.faces : expected.call_face.size();
  if (importer.n_vertices() != expected.vertices || importer.n_faces() != calls)
    throw InputError(fmt::format("{}: OpenMesh read {} vertices and {} faces of {} and {}", path,
                                 importer.n_vertices(), importer.n_faces(), expected.vertices, calls));
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (uint32_t v : expected.bad_vertices) scene.positions[v] = {kNan, kNan, kNan};
  scene.stats.faces = expected.faces;
}

// --- OBJ
// ----------------------------------------------------------------------------------------------------

/// Reads the materials of one MTL file into `materials` by name. What does not parse is left at its default.
void ReadMtl(const std::filesystem::path& path, std::map<std::string, Material, std::less<>>& materials) {
  std::ifstream in(path);
  std::string line;
  Material* m = nullptr;
  while (std::getline(in, line)) {
    Words words(line);
    std::string_view key = words.Next();
    if (key == "newmtl") {
      std::string name(words.Rest());
      m = &materials[name];
      *m = Material{};
      m->name = name;
      continue;
    }
    if (m == nullptr || key.empty() || key.starts_with('#')) continue;
    double x[3];
    int n = 0;
    while (n < 3 && ParseNumber(words.Next(), x[n]) == Number::kFinite) ++n;
    if (n == 0) continue;
    auto unit = [](double v) { return float(std::clamp(v, 0.0, 1.0)); };
    Vec3f color =
        n == 3 ? Vec3f{unit(x[0]), unit(x[1]), unit(x[2])} : Vec3f{unit(x[0]), unit(x[0]), unit(x[0])};
    if (key == "Kd") m->diffuse = color;
    if (key == "Ks") m->specular = color;
    if (key == "Ke") m->emission = color;
    if (key == "Ns") m->shininess = float(std::clamp(x[0], 1.0, 1e4));
    if (key == "Ni") m->ior = float(std::clamp(x[0], 1.0, 4.0));
    if (key == "d") m->transmit = Vec3f{1, 1, 1} * (1 - unit(x[0]));
    if (key == "Tr") m->transmit = Vec3f{1, 1, 1} * unit(x[0]);
    // Illumination models 3 to 9 have ray-traced reflection; `reflect` marks it until Ks is known.
    if (key == "illum") m->reflect = x[0] >= 3 && x[0] <= 9 ? Vec3f{1, 1, 1} : Vec3f{0, 0, 0};
  }
}

/// The strict pass over an OBJ file; adds its materials to the scene.
class ObjScan {
 public:
  ObjScan(const std::filesystem::path& path, std::string text, bool drop_bad, Scene& scene)
      : path_(path), text_(std::move(text)), drop_bad_(drop_bad), scene_(scene) {}

  Expected Run() {
    JoinContinuedLines();
    // Count first, since an index may refer to a vertex further down.
    ForEachLine([&](Words words) { vertex_count_ += words.Next() == "v"; });
    if (int64_t(vertex_count_) > kMaxCount)
      Fail(fmt::format("has {} vertices; {} are allowed", vertex_count_, kMaxCount));
    expected_.text.reserve(text_.size());
    ForEachLine([&](Words words) { Line(words); });
    if (expected_.faces == 0) Fail("has no faces; is it a Wavefront OBJ file?");
    return std::move(expected_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw InputError(path_.string() + ": " + what); }
  [[noreturn]] void FailLine(const std::string& what) const { Fail(fmt::format("line {}: {}", line_, what)); }

  /// Puts blanks for a backslash and the line break after it (and so counts the lines as one).
  void JoinContinuedLines() {
    for (size_t i = text_.find('\\'); i != text_.npos; i = text_.find('\\', i + 1)) {
      size_t end = i + 1 < text_.size() && text_[i + 1] == '\r' ? i + 2 : i + 1;
      if (end < text_.size() && text_[end] == '\n') text_.replace(i, end + 1 - i, end + 1 - i, ' ');
    }
  }

  template <class F>
  void ForEachLine(const F& f) {
    line_ = 0;
    for (size_t begin = 0; begin < text_.size();) {
      size_t end = std::min(text_.find('\n', begin), text_.size());
      ++line_;
      is_unended_line_ = end == text_.size();
      f(Words(std::string_view(text_).substr(begin, end - begin)));
      begin = end + 1;
    }
  }

  void Line(Words words) {
    std::string_view key = words.Next();
    if (key == "v") {
      Vertex(words);
    } else if (key == "f") {
      Face(words);
    } else if (key == "mtllib") {
      ReadMtl(path_.parent_path() / std::string(words.Rest()), library_);
    } else if (key == "usemtl") {
      material_ = MaterialIndex(words.Rest());
    }
  }

  void Vertex(Words& words) {
    std::string_view coordinates[3];
    bool finite = true;
    for (int i = 0; i < 3; ++i) {
      std::string_view word = coordinates[i] = words.Next();
      if (word.empty() || word.starts_with('#'))
        FailLine(fmt::format("vertex {} has {} coordinates; 3 are needed", expected_.vertices, i));
      CheckCoordinate(word, expected_.vertices, drop_bad_, finite,
                      [&](const std::string& what) { FailLine(what); });
    }
    expected_.AddVertex("v ", coordinates, finite, expected_.vertices++);
  }

  void Face(Words& words) {
    corners_.clear();
    size_t corner_count = 0;
    for (std::string_view word = words.Next(); !word.empty() && !word.starts_with('#'); word = words.Next()) {
      int64_t index = 0;
      if (!ParseInt(word.substr(0, word.find('/')), index) ||
          word.find_first_not_of("+-0123456789/") != word.npos)
        FailLine(fmt::format("face {} has the corner {}; an index such as 3 or 3/1/2 is needed",
                             expected_.faces, Quoted(word)));
      int64_t corner = index < 0 ? int64_t(expected_.vertices) + index + 1 : index;
      if (corner < 1 || corner > int64_t(vertex_count_)) {
        if (!drop_bad_)
          FailLine(fmt::format("face {} refers to vertex {}; allowed are 1 to {}, or -{} to -1",
                               expected_.faces, index, vertex_count_, expected_.vertices));
        corner = int64_t(vertex_count_ + corner_count) + 1;  // Finish() shall drop it; each its own
      }
      ++corner_count;
      if (std::find(corners_.begin(), corners_.end(), corner) == corners_.end()) corners_.push_back(corner);
    }
    // Faces of two corners are common and harmless, but not at the end of a file cut off within a line.
    if (corner_count == 0 || (corner_count < 3 && is_unended_line_))
      FailLine(fmt::format("face {} has {} corners; at least 3 are needed", expected_.faces, corner_count));
    // A repeated corner makes a degenerate triangle, which is left out; so would OpenMesh do, but uncounted.
    scene_.stats.degenerate_triangles +=
        std::max<size_t>(corner_count, 3) - std::max<size_t>(corners_.size(), 2);
    if (corners_.size() >= 3) {
      expected_.text += 'f';
      for (int64_t corner : corners_) expected_.AddNumber(corner);
      expected_.text += '\n';
      expected_.call_face.push_back(uint32_t(expected_.faces));
    }
    expected_.face_material.push_back(material_);
    if (int64_t(++expected_.faces) > kMaxCount) Fail(fmt::format("has more than {} faces", kMaxCount));
  }

  uint32_t MaterialIndex(std::string_view name) {
    auto [it, is_new] = index_.try_emplace(std::string(name), uint32_t(scene_.materials.size()));
    if (is_new) {
      Material m;
      if (auto found = library_.find(name); found != library_.end()) m = found->second;
      m.name = std::string(name);
      m.reflect = m.reflect * m.specular;
      m.diffuse = m.diffuse * (Vec3f{1, 1, 1} - m.transmit);
      scene_.materials.push_back(m);
    }
    return it->second;
  }

  const std::filesystem::path& path_;
  std::string text_;
  bool drop_bad_;
  Scene& scene_;
  Expected expected_;
  uint64_t vertex_count_ = 0, line_ = 0;
  bool is_unended_line_ = false;
  uint32_t material_ = 0;
  std::vector<int64_t> corners_;
  std::map<std::string, Material, std::less<>> library_;
  std::map<std::string, uint32_t, std::less<>> index_;
};

// --- OFF
// ----------------------------------------------------------------------------------------------------

/// The strict pass over an ASCII OFF file. Each vertex and each face has a line of its own; what follows the
/// position or the indices there (normals, colours, texture coordinates) is left out.
class OffScan {
 public:
  OffScan(const std::filesystem::path& path, std::string text, bool drop_bad, Scene& scene)
      : path_(path), text_(std::move(text)), drop_bad_(drop_bad), scene_(scene) {}

  Expected Run() {
    Words words = NextLine("the header OFF");
    std::string_view key = words.Next();
    if (!key.ends_with("OFF") || key.find_first_of("4n") != key.npos || key.size() > 7)
      FailLine(fmt::format("the header is {}; OFF, COFF, NOFF or STOFF is needed", Quoted(key)));
    if (words.Rest().starts_with("BINARY")) Fail("is binary; only ASCII OFF is read");
    if (words.Rest().empty()) words = NextLine("the line with the counts of vertices and faces");
    int64_t vertices, faces;
    if (!ParseInt(words.Next(), vertices) || !ParseInt(words.Next(), faces) || vertices < 0 ||
        vertices > kMaxCount || faces < 0 || faces > kMaxCount)
      FailLine(fmt::format(
          "the counts of vertices, faces and edges are needed, as in '8 6 12', each at most {}", kMaxCount));
    if (faces == 0) Fail("has no faces");
    expected_.vertices = uint64_t(vertices), expected_.faces = uint64_t(faces);
    expected_.text = fmt::format("OFF\n{} {} 0\n", vertices, faces);
    expected_.text.reserve(text_.size() + 64);
    for (uint64_t i = 0; i < expected_.vertices; ++i) Vertex(i);
    for (uint64_t i = 0; i < expected_.faces; ++i) Face(i);
    return std::move(expected_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw InputError(path_.string() + ": " + what); }
  [[noreturn]] void FailLine(const std::string& what) const { Fail(fmt::format("line {}: {}", line_, what)); }

  /// The next line with anything but blanks and a comment.
  template <class... Args>
  Words NextLine(const char* what, const Args&... args) {
    while (next_ < text_.size()) {
      size_t end = std::min(text_.find('\n', next_), text_.size());
      std::string_view line = std::string_view(text_).substr(next_, end - next_);
      line = line.substr(0, line.find('#'));
      next_ = end + 1, ++line_;
      if (!Words(line).Next().empty()) return Words(line);
    }
    Fail("ends early: " + fmt::format(fmt::runtime(what), args...) + " is missing");
  }

  void Vertex(uint64_t i) {
    Words words = NextLine("vertex {} of {}", i, expected_.vertices);
    std::string_view coordinates[3];
    bool finite = true;
    for (int k = 0; k < 3; ++k) {
      std::string_view word = coordinates[k] = words.Next();
      if (word.empty())
        FailLine(fmt::format("vertex {} has {} coordinates; 3 are needed, on a line of its own", i, k));
      CheckCoordinate(word, i, drop_bad_, finite, [&](const std::string& what) { FailLine(what); });
    }
    expected_.AddVertex("", coordinates, finite, i);
  }

  void Face(uint64_t i) {
    Words words = NextLine("face {} of {}", i, expected_.faces);
    int64_t corners = 0;
    std::string_view word = words.Next();
    if (!ParseInt(word, corners) || corners < 1)
      FailLine(fmt::format("face {} has {} corners; at least 3 are needed", i, Quoted(word)));
    scene_.stats.degenerate_triangles += corners < 3;
    expected_.text += word;
    for (int64_t k = 0; k < corners; ++k) {
      int64_t index = 0;
      word = words.Next();
      if (word.empty()) FailLine(fmt::format("face {} has {} of its {} corners on its line", i, k, corners));
      if (!ParseInt(word, index))
        FailLine(fmt::format("face {} has the corner {}; an index is needed", i, Quoted(word)));
      if (index < 0 || index >= int64_t(expected_.vertices)) {
        if (!drop_bad_)
          FailLine(fmt::format("face {} refers to vertex {}; allowed are 0 to {}", i, index,
                               int64_t(expected_.vertices) - 1));
        index = RAYBENCH_NONE;
      }
      expected_.AddNumber(index);
    }
    expected_.text += '\n';
  }

  const std::filesystem::path& path_;
  std::string text_;
  bool drop_bad_;
  Scene& scene_;
  Expected expected_;
  size_t next_ = 0;
  uint64_t line_ = 0;
};

}  // namespace

Scene ReadObj(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  scene.provenance.source = path.string();
  scene.materials.emplace_back().name = "default";
  Expected expected = ObjScan(path, ReadFile(path), options.drop_bad, scene).Run();
  ReadWithOpenMesh(OpenMesh::IO::OBJReader(), path.string(), std::move(expected), options, scene);
  return scene;
}

Scene ReadOff(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  scene.provenance.source = path.string();
  Expected expected = OffScan(path, ReadFile(path), options.drop_bad, scene).Run();
  ReadWithOpenMesh(OpenMesh::IO::OFFReader(), path.string(), std::move(expected), options, scene);
  return scene;
}

}  // namespace raybench
