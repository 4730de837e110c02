#include "harness/fuzz/isolate.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <utility>

#include "accel/base/error.h"
#include "accel/base/memory.h"

namespace raybench::fuzz {
namespace {

/// AddressSanitizer maps terabytes and has limits of its own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kLimitsMemory = false;
#else
constexpr bool kLimitsMemory = true;
#endif

/// Bytes of address space in use.
uint64_t MappedBytes() {
  uint64_t pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%lu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return pages * uint64_t(sysconf(_SC_PAGESIZE));
}

void Write(int out, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = write(out, text.data(), text.size());
    if (n < 0 && errno != EINTR) return;
    if (n > 0) text.remove_prefix(size_t(n));
  }
}

}  // namespace

double SecondsNow() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

namespace {
double SecondsOf(clockid_t clock) {
  timespec time{};
  return clock_gettime(clock, &time) == 0 ? double(time.tv_sec) + 1e-9 * double(time.tv_nsec) : 0;
}
}  // namespace

double ProcessorSeconds() { return SecondsOf(CLOCK_PROCESS_CPUTIME_ID); }

double Child::ProcessorSeconds() const {
  clockid_t clock;
  return clock_getcpuclockid(pid_, &clock) == 0 ? SecondsOf(clock) : 0;
}

bool IsHung(double seconds, double processor_seconds, double limit) {
  if (seconds > 6 * limit) return true;
  return seconds > limit && processor_seconds > limit / 2;
}

SharedBytes::SharedBytes(size_t size) : size_(size) {
  data_ = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (data_ == MAP_FAILED)
    throw InputError(fmt::format("no memory to share with children: {}", std::strerror(errno)));
}
SharedBytes::~SharedBytes() { munmap(data_, size_); }

Child::Child(const Limits& limits, const std::function<void(int)>& work) {
  int ends[2];
  if (pipe(ends) != 0) throw InputError(fmt::format("no pipe to a child: {}", std::strerror(errno)));
  std::fflush(nullptr);
  pid_ = fork();
  if (pid_ < 0) throw InputError(fmt::format("no child process: {}", std::strerror(errno)));
  if (pid_ == 0) {
    close(ends[0]);
    // Ctrl-C is the parent's matter.
    std::signal(SIGINT, SIG_IGN);
    std::signal(SIGTERM, SIG_DFL);
    for (int fatal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) std::signal(fatal, SIG_DFL);
    rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    if (kLimitsMemory) {
      const rlim_t most = MappedBytes() + (limits.megabytes << 20);
      const rlimit memory = {most, most};
      setrlimit(RLIMIT_AS, &memory);
    }
    if (limits.quiet) {
      const int nowhere = open("/dev/null", O_WRONLY);
      dup2(nowhere, STDOUT_FILENO), dup2(nowhere, STDERR_FILENO);
    }
    int code = 0;
    try {
      work(ends[1]);
    } catch (...) {
      code = 3;
    }
    std::fflush(nullptr);
    _exit(code);
  }
  close(ends[1]);
  out_ = ends[0];
  fcntl(out_, F_SETFL, O_NONBLOCK);
}

Child::Child(Child&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)), out_(std::exchange(other.out_, -1)) {}
Child& Child::operator=(Child&& other) noexcept {
  std::swap(pid_, other.pid_), std::swap(out_, other.out_);
  return *this;
}
Child::~Child() {
  if (pid_ > 0) Kill(), Wait();
  if (out_ >= 0) close(out_);
}

void Child::Kill() { kill(pid_, SIGKILL); }

bool Child::Read(std::string& text) const {
  char buffer[1 << 14];
  for (;;) {
    const ssize_t n = read(out_, buffer, sizeof buffer);
    if (n > 0) text.append(buffer, size_t(n));
    if (n == 0) return false;
    if (n < 0) return errno == EAGAIN || errno == EINTR;
  }
}

std::string Child::Wait() {
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  if (WIFSIGNALED(status)) {
    const char* name = sigabbrev_np(WTERMSIG(status));
    return fmt::format("is killed by SIG{}", name != nullptr ? name : "?");
  }
  if (WEXITSTATUS(status) == 3) return "throws an exception through the contract";
  return WEXITSTATUS(status) == 0 ? std::string()
                                  : fmt::format("ends the process with exit code {}", WEXITSTATUS(status));
}

std::string RunIsolated(const Limits& limits, const std::function<std::string()>& work, std::string& output) {
  output.clear();
  Child child(limits, [&](int out) { Write(out, work()); });
  const double begin = SecondsNow();
  for (;;) {
    pollfd waiting = {child.out(), POLLIN, 0};
    poll(&waiting, 1, 100);
    if (!child.Read(output)) return child.Wait();
    if (IsHung(SecondsNow() - begin, child.ProcessorSeconds(), limits.seconds)) {
      child.Kill(), child.Wait();
      return fmt::format("does not end within {} s", limits.seconds);
    }
  }
}

}  // namespace raybench::fuzz
