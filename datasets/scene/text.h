// Words and numbers of text files.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace raybench {

/// The whole file. Throws InputError: missing, a directory, empty, unreadable.
std::string ReadFile(const std::filesystem::path& path);

/// Makes of what was read from `path` the text that readers take: without a byte-order mark, and with '\n'
/// for a '\r' that no '\n' follows. Throws InputError: UTF-16 or UTF-32.
void MakePlain(const std::filesystem::path& path, std::string& text);

/// The line ends alone, from byte `start` on; nothing moves.
void MakeLineEndsPlain(std::string& text, size_t start = 0);

/// ReadFile(), made plain.
std::string ReadText(const std::filesystem::path& path);

/// Things that were left out, how many of each, in one line: "curv (2), p, usemtl of unknown 'wood' (3)".
class Counts {
 public:
  void Add(std::string_view what) {
    const auto it = counts_.find(what);
    it == counts_.end() ? void(counts_.emplace(what, 1)) : void(++it->second);
  }
  bool empty() const { return counts_.empty(); }
  /// In alphabetical order; of many kinds the first ones.
  std::string Text() const;

 private:
  std::map<std::string, uint64_t, std::less<>> counts_;
};

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
  /// Those from the byte `start` on.
  explicit Lines(std::string_view text, size_t start = 0) : text_(text), next_(start) {}
  /// False at the end. The line comes without its line break.
  bool Next(std::string_view& line) {
    if (next_ >= text_.size()) return false;
    const size_t end = std::min(text_.find('\n', next_), text_.size());
    line = text_.substr(next_, end - next_);
    is_unended_ = end == text_.size();
    next_ = end + 1;
    ++number_;
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

/// What a message says that --drop-bad would make good.
inline constexpr char kOrDropBad[] = " (--drop-bad leaves out what has or uses it)";

enum class Number { kFinite, kNotFinite, kMalformed };

/// The float nearest to a decimal number, which may begin with '+'. kNotFinite: "nan", "inf", or beyond the
/// range of float.
Number ParseNumber(std::string_view word, float& value);

/// False if the word is not a decimal integer (which may begin with '+') in the range of int64.
bool ParseInt(std::string_view word, int64_t& value);

}  // namespace raybench
