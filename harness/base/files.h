// Files that are whole or not there, in folders that one process writes.
#pragma once

#include <filesystem>
#include <string>

namespace raybench {

/// Writes through a temporary file that is then renamed. Throws InputError naming the file.
void WriteFileAtomically(const std::filesystem::path& path, const std::string& text);

/// A folder for one process alone, by flock() on its file .lock: what a killed process leaves holds nobody
/// up.
class OneProcessLock {
 public:
  /// The folder must be there. Throws InputError if another process holds it, or nothing can be written
  /// there.
  explicit OneProcessLock(const std::filesystem::path& folder);
  OneProcessLock(const OneProcessLock&) = delete;
  ~OneProcessLock();

 private:
  int file_ = -1;
};

}  // namespace raybench
