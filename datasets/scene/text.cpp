#include "datasets/scene/text.h"

#include <fmt/format.h>

#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "accel/base/error.h"

namespace raybench {

std::string ReadFile(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw InputError(path.string() + ": no such file");
  if (std::filesystem::is_directory(status)) throw InputError(path.string() + ": is a directory, not a file");
  std::ifstream in(path, std::ios::binary);
  if (!in) throw InputError(path.string() + ": cannot be opened for reading");
  // A pipe has no size; a file may still be growing.
  const uintmax_t size = std::filesystem::file_size(path, error);
  std::string text;
  size_t filled = 0;
  for (size_t room = error ? 1 << 16 : size_t(size) + 1; in; room = std::max(filled, size_t{1} << 16)) {
    text.resize(filled + room);
    in.read(text.data() + filled, std::streamsize(room));
    filled += size_t(in.gcount());
  }
  if (in.bad()) throw InputError(path.string() + ": cannot be read");
  text.resize(filled);
  if (text.empty()) throw InputError(path.string() + ": is empty");
  return text;
}

void MakePlain(const std::filesystem::path& path, std::string& text) {
  const std::string_view start = std::string_view(text).substr(0, 4);
  const bool is_wide = start.starts_with("\xFF\xFE") || start.starts_with("\xFE\xFF") ||
                       start == std::string_view("\0\0\xFE\xFF", 4) ||
                       (start.size() > 1 && (start[0] == 0) != (start[1] == 0));
  if (is_wide) throw InputError(path.string() + ": is text in UTF-16 or UTF-32; save it as UTF-8");
  if (start.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  MakeLineEndsPlain(text);
}

void MakeLineEndsPlain(std::string& text, size_t start) {
  for (size_t i = text.find('\r', start); i != text.npos; i = text.find('\r', i + 1))
    if (i + 1 == text.size() || text[i + 1] != '\n') text[i] = '\n';
}

std::string ReadText(const std::filesystem::path& path) {
  std::string text = ReadFile(path);
  MakePlain(path, text);
  return text;
}

std::string Counts::Text() const {
  constexpr size_t kShown = 12;
  std::string text;
  size_t n = 0;
  for (const auto& [what, count] : counts_) {
    if (n++ == kShown) return text + fmt::format(" and {} more", counts_.size() - kShown);
    text += fmt::format("{}{}", text.empty() ? "" : ", ", OneLine(what.substr(0, 60)));
    if (count > 1) text += fmt::format(" ({})", count);
  }
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

std::string Quoted(std::string_view text) { return OneLine(fmt::format("'{}'", text.substr(0, 40))); }

Number ParseNumber(std::string_view word, float& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || end != word.data() + word.size()) return Number::kMalformed;
  if (error == std::errc::result_out_of_range)
    value = std::strtof(std::string(word).c_str(), nullptr);  // tiny or inf
  else if (error != std::errc())
    return Number::kMalformed;
  return std::isfinite(value) ? Number::kFinite : Number::kNotFinite;
}

bool ParseInt(std::string_view word, int64_t& value) {
  if (word.starts_with('+')) word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return !word.empty() && error == std::errc() && end == word.data() + word.size();
}

}  // namespace raybench
