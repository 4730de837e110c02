// Ctrl-C: asked for once, a run stops at the next safe place and keeps what is finished; twice, it dies.
#pragma once

#include <exception>

namespace raybench {

struct InterruptedError : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

/// Catches SIGINT and SIGTERM from now on, unless they are ignored; the second one has its usual effect.
void CatchInterrupts();
bool Interrupted();
void ThrowIfInterrupted();
/// For rb_build_options.cancel.
const volatile int* InterruptFlag();

}  // namespace raybench
