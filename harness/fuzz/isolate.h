// Work in a child process: what crashes, hangs or eats memory there is told, and this process goes on.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

namespace raybench::fuzz {

/// What a child writes and its parent reads, also when the child is dead: memory that both share.
struct Stage {
  std::atomic<uint64_t> index{0};      ///< of the case
  std::atomic<double> since{0};        ///< SecondsNow() when it began
  std::atomic<double> processor{0};    ///< ProcessorSeconds() when it began
  std::atomic<const char*> check{""};  ///< text that lives as long as the program
};

/// Of a steady clock, the same in parent and child.
double SecondsNow();
/// Processor time of this process so far.
double ProcessorSeconds();

/// Whether what has taken so long is not going to end: it has computed for half of `limit`. What waits, or gets
/// little of a busy machine's processor, is given six times as long.
bool IsHung(double seconds, double processor_seconds, double limit);

/// Memory shared with children that are forked later, for `count` objects made with T(). Lives as long as the
/// object.
template <class T>
class Shared;

class SharedBytes {
 public:
  explicit SharedBytes(size_t size);
  ~SharedBytes();
  SharedBytes(const SharedBytes&) = delete;
  void* data() const { return data_; }

 private:
  void* data_;
  size_t size_;
};

template <class T>
class Shared {
 public:
  explicit Shared(size_t count) : bytes_(count * sizeof(T)) {
    for (size_t i = 0; i < count; ++i) new (&(*this)[i]) T();
  }
  T& operator[](size_t i) const { return static_cast<T*>(bytes_.data())[i]; }

 private:
  SharedBytes bytes_;
};

struct Limits {
  double seconds = 20;
  uint64_t megabytes = 2048;  ///< beyond what the process has when it begins
  bool quiet = true;          ///< its stderr goes nowhere
};

/// A forked child. The process that forks must have one thread.
class Child {
 public:
  /// Runs `work` in the child with a file descriptor to write to, then ends the child with exit code 0.
  Child(const Limits& limits, const std::function<void(int out)>& work);
  ~Child();  ///< kills it
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;

  int out() const { return out_; }  ///< readable end; non-blocking
  /// Appends what it wrote since. False when it has closed its end.
  bool Read(std::string& text) const;
  /// Waits for its end; how it ended in words, empty if well.
  std::string Wait();
  void Kill();
  /// Processor time so far; 0 when it has ended.
  double ProcessorSeconds() const;

 private:
  int pid_ = -1, out_ = -1;
};

/// Runs `work` in a child of its own until it ends or is hung. `output`: what it returned. The
/// result says how it ended otherwise, such as "is killed by SIGSEGV", "does not end within 20 s"; empty: it
/// ended well.
std::string RunIsolated(const Limits& limits, const std::function<std::string()>& work, std::string& output);

}  // namespace raybench::fuzz
