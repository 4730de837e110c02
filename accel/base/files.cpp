#include "accel/base/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "accel/base/error.h"

namespace raybench {
namespace fs = std::filesystem;

void WriteFileAtomically(const fs::path& path, std::initializer_list<std::string_view> parts) {
  const fs::path temporary = fmt::format("{}.{}.tmp", path.string(), getpid());
  std::error_code error;
  {
    errno = 0;
    std::ofstream out(temporary, std::ios::binary);
    for (std::string_view part : parts) out.write(part.data(), std::streamsize(part.size()));
    out.close();
    if (!out) {
      const std::string why = std::strerror(errno != 0 ? errno : EIO);  // of the write that failed
      fs::remove(temporary, error);
      throw InputError(fmt::format("{}: cannot be written: {}", path.string(), why));
    }
  }
  fs::rename(temporary, path, error);
  if (error) {
    const std::string why = error.message();
    fs::remove(temporary, error);
    throw InputError(fmt::format("{}: cannot be written: {}", path.string(), why));
  }
}

OneProcessLock::OneProcessLock(const fs::path& folder) {
  file_ = open((folder / ".lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (file_ < 0)
    throw InputError(fmt::format("{}: cannot be written: {}", folder.string(), std::strerror(errno)));
  if (flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;  // not every file system can lock
  close(file_);
  throw InputError(fmt::format("{}: another raybench is writing there; wait for it, or choose another --out",
                               folder.string()));
}

OneProcessLock::~OneProcessLock() { close(file_); }

}  // namespace raybench
