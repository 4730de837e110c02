// OFF, the Object File Format of Geomview.

#include <fmt/format.h>

#include "datasets/readers/readers.h"
#include "datasets/readers/text_reader.h"

namespace raybench {
namespace {

/// Reads an ASCII OFF file. Each vertex and each face has a line of its own; what follows the position or the
/// indices there (normals, colours, texture coordinates) is left out.
class OffReader : MeshReader {
 public:
  OffReader(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : MeshReader(path, ReadText(path), options, scene) {}

  void Run() {
    Words words = NextLine("the header OFF");
    std::string_view key = words.Next();
    if (!key.ends_with("OFF") || key.find_first_of("4n") != key.npos || key.size() > 7)
      FailHere(fmt::format("the header is {}; OFF, COFF, NOFF or STOFF is needed", Quoted(key)));
    if (words.Rest().starts_with("BINARY")) Fail("is binary; only ASCII OFF is read");
    if (words.Rest().empty()) words = NextLine("the line with the counts of vertices and faces");
    int64_t vertices, faces;
    if (!ParseInt(words.Next(), vertices) || !ParseInt(words.Next(), faces) || vertices < 0 ||
        vertices > kMaxCount || faces < 0 || faces > kMaxCount)
      FailHere(fmt::format(
          "the counts of vertices, faces and edges are needed, as in '8 6 12', each at most {}", kMaxCount));
    if (faces == 0) Fail("has no faces");
    Expect(uint64_t(vertices), uint64_t(faces));
    uint64_t more_of_vertices = 0, more_of_faces = 0;  // normals, colours, texture coordinates
    for (int64_t i = 0; i < vertices; ++i) {
      words = NextLine("vertex {} of {}", i, vertices);
      AddVertex(words, "3 are needed, on a line of its own");
      more_of_vertices += !words.Next().empty();
      TellProgress(lines_.offset());
    }
    for (int64_t i = 0; i < faces; ++i) {
      words = NextLine("face {} of {}", i, faces);
      Face(words);
      more_of_faces += !words.Next().empty();
      TellProgress(lines_.offset());
    }
    if (more_of_vertices > 0)
      NoteLeftOut(fmt::format("what follows the positions of {} vertices", more_of_vertices));
    if (more_of_faces > 0) NoteLeftOut(fmt::format("what follows the corners of {} faces", more_of_faces));
    sink_.Close();
  }

 private:
  /// The next line with anything but blanks and a comment.
  template <class... Args>
  Words NextLine(const char* what, const Args&... args) {
    std::string_view line;
    while (lines_.Next(line)) {
      line = line.substr(0, line.find('#'));
      if (!Words(line).Next().empty()) return Words(line);
    }
    FailEarly(fmt::format(fmt::runtime(what), args...));
  }

  void Face(Words& words) {
    const uint64_t face = sink_.faces();
    int64_t count = 0;
    std::string_view word = words.Next();
    if (!ParseInt(word, count) || count < 1)
      FailHere(fmt::format("face {} has {} corners; at least 3 are needed", face, Quoted(word)));
    corners_.clear();
    for (int64_t k = 0; k < count; ++k) {
      word = words.Next();
      if (word.empty()) FailHere(fmt::format("face {} has {} of its {} corners on its line", face, k, count));
      corners_.push_back(Corner(Index(word, "face", face)));
    }
    AddFace(corners_);
  }

  std::vector<uint32_t> corners_;
};

Scene ReadOff(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  OffReader(path, options, scene).Run();
  return scene;
}

}  // namespace

const Format kOff = {".off", ReadOff};

}  // namespace raybench
