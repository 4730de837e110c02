// What the readers of text files share: the text and the place in it, the wording of messages, checks of
// coordinates and corners, and progress. A reader derives from one of these two.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "datasets/readers/mesh_sink.h"
#include "datasets/scene/scene.h"
#include "datasets/scene/text.h"

namespace raybench {

/// Reads a file into a scene on which Finish() has not run yet.
class TextReader {
 protected:
  /// Reading goes on to the fraction `until` of loading.
  TextReader(const std::filesystem::path& path, std::string text, const LoadOptions& options, Scene& scene,
             double until = 0.95);
  TextReader(const TextReader&) = delete;
  ~TextReader() = default;

  /// Throw InputError: "PATH: what"; "PATH: line 3: what"; "PATH: ends early: what is missing".
  [[noreturn]] void Fail(const std::string& what) const;
  [[noreturn]] void FailHere(const std::string& what) const { Fail(Where() + ": " + what); }
  [[noreturn]] void FailEarly(const std::string& what) const;
  virtual std::string Where() const;

  /// The next line that is neither blank nor a comment: its first word, and the words after that.
  bool NextStatement(std::string_view& key, Words& words);
  /// The next word of the file, empty at its end.
  std::string_view NextWord() {
    while (true) {
      const std::string_view word = words_.Next();
      std::string_view line;
      if (!word.empty() || !lines_.Next(line)) return word;
      words_ = Words(line);
    }
  }

  /// The word as a coordinate. `whose`, with {} for the index, is as in "vertex {} has the coordinate". Fails
  /// if it is no number, or not finite and not to be dropped.
  float Coordinate(std::string_view word, const char* whose, uint64_t index) const;

  /// To be called at every step; passes on every 2^16th.
  void TellProgress(size_t offset) {
    if ((++steps_ & 0xFFFF) == 0 && options_.progress)
      options_.progress(until_ * double(offset) / double(text_.size()));
  }

  const std::filesystem::path& path_;
  const LoadOptions& options_;
  Scene& scene_;
  std::string text_;
  Lines lines_;
  Words words_{""};  ///< of the line in which NextWord() is

 private:
  double until_;
  uint32_t steps_ = 0;
};

/// Reads the vertices and faces of a file, each numbered from 0.
class MeshReader : public TextReader {
 protected:
  using TextReader::TextReader;
  ~MeshReader() = default;

  /// How many there will be.
  void Expect(uint64_t vertices, uint64_t faces) { sink_.Expect(vertices, faces, text_.size()); }

  /// A coordinate of the next vertex.
  float Coordinate(std::string_view word) const;
  /// The next vertex; `needed` ends the message if there are fewer than three coordinates.
  void AddVertex(Words& words, const char* needed);

  /// The word as a corner of the item `kind` `i`; fails if it is no number.
  int64_t Index(std::string_view word, std::string_view kind, uint64_t i) const;
  /// The vertex of a corner of the next face. One that is not there is refused, in terms of the file's own
  /// `index` and of what is `allowed()`, or becomes RAYBENCH_NONE to be dropped by Finish().
  template <class Allowed>
  uint32_t Corner(int64_t index, int64_t vertex, const Allowed& allowed) const {
    if (vertex >= 0 && vertex < int64_t(sink_.vertices())) return uint32_t(vertex);
    if (!options_.drop_bad) FailCorner(index, allowed());
    return RAYBENCH_NONE;
  }
  uint32_t Corner(int64_t index) const {
    return Corner(index, index, [&] { return "0 to " + std::to_string(int64_t(sink_.vertices()) - 1); });
  }
  void AddFace(std::span<const uint32_t> corners, uint32_t material = 0);

  /// Notes what of the file the scene has not.
  void NoteLeftOut(const std::string& what);

  MeshSink sink_{scene_};

 private:
  [[noreturn]] void FailCorner(int64_t index, const std::string& allowed) const;
};

}  // namespace raybench
