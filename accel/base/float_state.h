// IEEE floating-point state: round to nearest, subnormals kept, whatever the caller or a library has set.
#pragma once

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace raybench {

/// Sets the state of this thread, IEEE unless said otherwise, for its lifetime and restores what was there.
class FloatState {
 public:
  /// Values of the control register: all exceptions masked, round to nearest; the other one takes subnormals
  /// for zero, read or made.
  static constexpr unsigned kIeee = 0x1F80, kFlushing = 0x9FC0;

#if defined(__SSE__)
  explicit FloatState(unsigned state = kIeee) : saved_(_mm_getcsr()) {
    if (saved_ != state) _mm_setcsr(state);
  }
  ~FloatState() {
    if (_mm_getcsr() != saved_) _mm_setcsr(saved_);
  }

 private:
  unsigned saved_;

 public:
#else
  explicit FloatState(unsigned = kIeee) {}
  ~FloatState() {}
#endif

  FloatState(const FloatState&) = delete;
  FloatState& operator=(const FloatState&) = delete;
};

}  // namespace raybench
