// OFF, the Object File Format of Geomview.

#include <fmt/format.h>

#include <OpenMesh/Core/IO/reader/OFFReader.hh>

#include "datasets/readers/mesh_sink.h"
#include "datasets/readers/openmesh_importer.h"
#include "datasets/readers/readers.h"

namespace raybench {
namespace {

/// The strict pass over an ASCII OFF file. Each vertex and each face has a line of its own; what follows the
/// position or the indices there (normals, colours, texture coordinates) is left out.
class OffScan {
 public:
  OffScan(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : path_(path),
        drop_bad_(options.drop_bad),
        scene_(scene),
        text_(ReadText(path)),
        stage_(options, 0, 0.4) {}

  CleanMesh Run() {
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
    mesh_.vertices = uint64_t(vertices), mesh_.faces = uint64_t(faces);
    mesh_.text.reserve(text_.size() + text_.size() / 16 + 64);
    mesh_.text = Header(mesh_.faces);
    for (uint64_t i = 0; i < mesh_.vertices; ++i) Vertex(i);
    for (uint64_t i = 0; i < mesh_.faces; ++i) Face(i);
    for (const auto& [count, what] : {std::pair{more_of_vertices_, "positions of {} vertices"},
                                      std::pair{more_of_faces_, "corners of {} faces"}})
      if (count > 0)
        scene_.stats.notes.push_back("left out: what follows the " + fmt::format(fmt::runtime(what), count));
    const std::string header = Header(mesh_.faces - mesh_.held_back.size());
    mesh_.text.replace(0, header.size(), header);
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw InputError(path_.string() + ": " + what); }
  [[noreturn]] void FailLine(const std::string& what) const {
    Fail(fmt::format("line {}: {}", lines_.number(), what));
  }

  /// Of the same length for any number of faces.
  std::string Header(uint64_t faces) const {
    return fmt::format("OFF\n{} {:<10} 0\n", mesh_.vertices, faces);
  }

  /// The next line with anything but blanks and a comment.
  template <class... Args>
  Words NextLine(const char* what, const Args&... args) {
    std::string_view line;
    while (lines_.Next(line)) {
      line = line.substr(0, line.find('#'));
      if (!Words(line).Next().empty()) return Words(line);
    }
    Fail("ends early: " + fmt::format(fmt::runtime(what), args...) + " is missing");
  }

  void Vertex(uint64_t i) {
    Words words = NextLine("vertex {} of {}", i, mesh_.vertices);
    std::string_view coordinates[3];
    Vec3f position;
    bool is_finite = true;
    for (int k = 0; k < 3; ++k) {
      const std::string_view word = coordinates[k] = words.Next();
      if (word.empty())
        FailLine(fmt::format("vertex {} has {} coordinates; 3 are needed, on a line of its own", i, k));
      const Number number = ParseNumber(word, position[k]);
      is_finite &= number == Number::kFinite;
      CheckCoordinate(number, word, i, drop_bad_, [&](const std::string& what) { FailLine(what); });
    }
    more_of_vertices_ += !words.Next().empty();
    if (!is_finite) mesh_.bad_vertices.push_back({uint32_t(i), position});
    for (std::string_view word : coordinates) (mesh_.text += is_finite ? word : "0") += ' ';
    mesh_.text += '\n';
    stage_.Tell(lines_.offset(), text_.size());
  }

  void Face(uint64_t i) {
    Words words = NextLine("face {} of {}", i, mesh_.faces);
    const size_t begin = mesh_.text.size();
    int64_t corners = 0;
    std::string_view word = words.Next();
    if (!ParseInt(word, corners) || corners < 1)
      FailLine(fmt::format("face {} has {} corners; at least 3 are needed", i, Quoted(word)));
    scene_.stats.degenerate_triangles += corners < 3;
    mesh_.text += fmt::format_int(corners).c_str();
    corners_.clear();
    bool is_bad = false;
    for (int64_t k = 0; k < corners; ++k) {
      int64_t index = 0;
      word = words.Next();
      if (word.empty()) FailLine(fmt::format("face {} has {} of its {} corners on its line", i, k, corners));
      if (!ParseInt(word, index))
        FailLine(fmt::format("face {} has the corner {}; an index is needed", i, Quoted(word)));
      if (index < 0 || index >= int64_t(mesh_.vertices)) {
        if (!drop_bad_)
          FailLine(fmt::format("face {} refers to vertex {}; allowed are 0 to {}{}", i, index,
                               int64_t(mesh_.vertices) - 1, kOrDropBad));
        index = RAYBENCH_NONE;
        is_bad = true;
      }
      corners_.push_back(uint32_t(index));
      (mesh_.text += ' ') += fmt::format_int(index).c_str();
    }
    more_of_faces_ += !words.Next().empty();
    mesh_.text += '\n';
    if (is_bad) {
      mesh_.text.resize(begin);
      mesh_.held_back.push_back({uint32_t(i), corners_});
    }
    stage_.Tell(lines_.offset(), text_.size());
  }

  const std::filesystem::path& path_;
  bool drop_bad_;
  Scene& scene_;
  std::string text_;
  LoadStage stage_;
  Lines lines_{text_};
  CleanMesh mesh_;
  std::vector<uint32_t> corners_;
  uint64_t more_of_vertices_ = 0, more_of_faces_ = 0;  ///< normals, colours, texture coordinates
};

}  // namespace

Scene ReadOff(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  scene.provenance.source = path.string();
  CleanMesh mesh = OffScan(path, options, scene).Run();
  ReadWithOpenMesh(OpenMesh::IO::OFFReader(), path.string(), std::move(mesh), options, scene);
  return scene;
}

}  // namespace raybench
