// IEEE floating-point state: round to nearest, subnormals kept, whatever the caller or a library has set.
#pragma once

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace raybench {

/// Sets the IEEE state of this thread for its lifetime and restores what was there.
class FloatState {
 public:
#if defined(__SSE__)
  FloatState() : saved_(_mm_getcsr()) {
    if (saved_ != kIeee) _mm_setcsr(kIeee);
  }
  ~FloatState() {
    if (_mm_getcsr() != saved_) _mm_setcsr(saved_);
  }

 private:
  static constexpr unsigned kIeee = 0x1F80;  // all exceptions masked, nearest, no flush-to-zero
  unsigned saved_;
#else
  FloatState() {}
  ~FloatState() {}
#endif
 public:
  FloatState(const FloatState&) = delete;
  FloatState& operator=(const FloatState&) = delete;
};

}  // namespace raybench
