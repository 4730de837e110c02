#include "datasets/readers/text_reader.h"

#include <fmt/format.h>

namespace raybench {

TextReader::TextReader(const std::filesystem::path& path, std::string text, const LoadOptions& options,
                       Scene& scene, double until)
    : path_(path), options_(options), scene_(scene), text_(std::move(text)), lines_(text_), until_(until) {}

void TextReader::Fail(const std::string& what) const { throw InputError(path_.string() + ": " + what); }

void TextReader::FailEarly(const std::string& what) const {
  Fail(fmt::format("ends early: {} is missing", what));
}

std::string TextReader::Where() const { return fmt::format("line {}", lines_.number()); }

bool TextReader::NextStatement(std::string_view& key, Words& words) {
  for (std::string_view line; lines_.Next(line);) {
    words = Words(line);
    key = words.Next();
    if (!key.empty() && !key.starts_with('#')) return true;
  }
  return false;
}

float TextReader::Coordinate(std::string_view word, const char* whose, uint64_t index) const {
  float value = 0;
  const Number number = ParseNumber(word, value);
  const auto fail = [&](const std::string& rule) {
    FailHere(fmt::format("{} {}; {}", fmt::format(fmt::runtime(whose), index), Quoted(word), rule));
  };
  if (number == Number::kMalformed) fail("a number is needed");
  if (number == Number::kNotFinite && !options_.drop_bad) fail(std::string("it must be finite") + kOrDropBad);
  return value;
}

float MeshReader::Coordinate(std::string_view word) const {
  return TextReader::Coordinate(word, "vertex {} has the coordinate", scene_.positions.size());
}

void MeshReader::AddVertex(Words& words, const char* needed) {
  Vec3f position;
  for (int k = 0; k < 3; ++k) {
    const std::string_view word = words.Next();
    if (word.empty() || word.starts_with('#'))
      FailHere(fmt::format("vertex {} has {} coordinates; {}", scene_.positions.size(), k, needed));
    position[k] = Coordinate(word);
  }
  sink_.AddVertex(position);
}

int64_t MeshReader::Index(std::string_view word, std::string_view kind, uint64_t i) const {
  int64_t index = 0;
  if (!ParseInt(word, index))
    FailHere(fmt::format("{} {} has the corner {}; an index is needed", kind, i, Quoted(word)));
  return index;
}

void MeshReader::FailCorner(int64_t index, const std::string& allowed) const {
  FailHere(fmt::format("face {} refers to vertex {}; allowed are {}{}", sink_.faces(), index, allowed,
                       kOrDropBad));
}

void MeshReader::AddFace(std::span<const uint32_t> corners, uint32_t material) {
  sink_.AddFace(corners, material);
  if (int64_t(sink_.faces()) > kMaxCount) Fail(fmt::format("has more than {} faces", kMaxCount));
}

void MeshReader::NoteLeftOut(const std::string& what) { scene_.stats.notes.push_back("left out: " + what); }

}  // namespace raybench
