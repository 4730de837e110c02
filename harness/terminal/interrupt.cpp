#include "harness/terminal/interrupt.h"

#include <csignal>
#include <initializer_list>

namespace raybench {
namespace {

volatile int g_interrupted = 0;

void OnSignal(int) { g_interrupted = 1; }

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

bool Interrupted() { return g_interrupted != 0; }

void ThrowIfInterrupted() {
  if (Interrupted()) throw InterruptedError();
}

const volatile int* InterruptFlag() { return &g_interrupted; }

}  // namespace raybench
