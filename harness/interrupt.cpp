#include "harness/interrupt.h"

#include <csignal>

namespace raybench {
namespace {

volatile int g_interrupted = 0;

void OnSignal(int) { g_interrupted = 1; }

}  // namespace

void CatchInterrupts() {
  struct sigaction action = {};
  action.sa_handler = &OnSignal;
  action.sa_flags = int(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool Interrupted() { return g_interrupted != 0; }

void ThrowIfInterrupted() {
  if (Interrupted()) throw InterruptedError();
}

const volatile int* InterruptFlag() { return &g_interrupted; }

}  // namespace raybench
