// Files that are whole or not there, in folders that one process writes.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

namespace raybench {

/// Writes the parts, one behind the other, to a temporary file that is then renamed: the file is whole, or what
/// it was. Throws InputError naming the file and why it cannot be written.
void WriteFileAtomically(const std::filesystem::path& path, std::initializer_list<std::string_view> parts);
inline void WriteFileAtomically(const std::filesystem::path& path, const std::string& text) {
  WriteFileAtomically(path, {std::string_view(text)});
}

/// A folder for one process alone, by flock() on its file .lock: what a killed process leaves holds
/// nobody up.
class OneProcessLock {
 public:
  /// The folder must be there. Throws InputError if another process holds it, or nothing can be
  /// written there.
  explicit OneProcessLock(const std::filesystem::path& folder);
  OneProcessLock(const OneProcessLock&) = delete;
  ~OneProcessLock();

 private:
  int file_ = -1;
};

}  // namespace raybench
