#include "harness/terminal/interrupt.h"

#include <csignal>
#include <initializer_list>

namespace raybench {
namespace {

/// Written by the signal handler, read by all threads: as an atomic (accel/contract/cancel.h).
volatile int g_interrupted = 0;

void OnSignal(int) { __atomic_store_n(&g_interrupted, 1, __ATOMIC_RELAXED); }

}  // namespace

void CatchInterrupts() {
  for (int signal : {SIGINT, SIGTERM}) {
    struct sigaction action = {};
    sigaction(signal, nullptr, &action);
    if (action.sa_handler == SIG_IGN) continue;  // a shell that runs us in the background wants that
    action = {};
    action.sa_handler = &OnSignal;
    action.sa_flags = int(SA_RESETHAND);
    sigaction(signal, &action, nullptr);
  }
}

bool Interrupted() { return __atomic_load_n(&g_interrupted, __ATOMIC_RELAXED) != 0; }

void ThrowIfInterrupted() {
  if (Interrupted()) throw InterruptedError();
}

const volatile int* InterruptFlag() { return &g_interrupted; }

}  // namespace raybench
