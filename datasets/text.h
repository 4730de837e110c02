// Words and numbers of text files.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace raybench {

/// The whole file. Throws InputError: missing, a directory, empty, unreadable.
std::string ReadFile(const std::filesystem::path& path);

/// Text in one line: line breaks become "; ", control characters and runs of blanks become one blank.
std::string OneLine(const std::string& text);

/// The beginning of the text in quotes and in one line, for messages.
std::string Quoted(std::string_view text);

inline bool IsBlank(char c) { return c == ' ' || (c >= '\t' && c <= '\r' && c != '\n'); }

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
  /// What is left, without blanks around it.
  std::string_view Rest() {
    while (p_ < end_ && IsBlank(*p_)) ++p_;
    const char* end = end_;
    while (end > p_ && IsBlank(end[-1])) --end;
    return {p_, size_t(end - p_)};
  }

 private:
  const char *p_, *end_;
};

/// The lines of a text, numbered from 1.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}
  /// False at the end. The line comes without its line break.
  bool Next(std::string_view& line) {
    if (next_ >= text_.size()) return false;
    const size_t end = std::min(text_.find('\n', next_), text_.size());
    line = text_.substr(next_, end - next_);
    is_unended_ = end == text_.size();
    next_ = end + 1, ++number_;
    return true;
  }
  uint64_t number() const { return number_; }                      ///< of the last line
  bool is_unended() const { return is_unended_; }                  ///< the last line had no line break
  size_t offset() const { return std::min(next_, text_.size()); }  ///< where the next line begins

 private:
  std::string_view text_;
  size_t next_ = 0;
  uint64_t number_ = 0;
  bool is_unended_ = false;
};

/// "vertex 3 has the coordinate 'nan'; it must be finite"
std::string CoordinateMessage(std::string_view word, uint64_t vertex, const char* rule);

enum class Number { kFinite, kNotFinite, kMalformed };

/// The float nearest to a decimal number, which may begin with '+'. kNotFinite: "nan", "inf", or beyond the
/// range of float.
Number ParseNumber(std::string_view word, float& value);

/// Calls `fail` with a message unless the number is finite, or `drop_bad` and it is not malformed.
template <class Fail>
void CheckCoordinate(Number number, std::string_view word, uint64_t vertex, bool drop_bad, const Fail& fail) {
  if (number == Number::kMalformed) fail(CoordinateMessage(word, vertex, "a number is needed"));
  if (number == Number::kNotFinite && !drop_bad) fail(CoordinateMessage(word, vertex, "it must be finite"));
}

/// False if the word is not a decimal integer (which may begin with '+') in the range of int64.
bool ParseInt(std::string_view word, int64_t& value);

}  // namespace raybench
