#include "harness/terminal/load.h"

#include <fmt/format.h>

#include "harness/terminal/interrupt.h"
#include "harness/terminal/progress.h"

namespace raybench {

Scene LoadWithProgress(const std::string& name, LoadOptions options) {
  Progress progress;
  options.progress = [&](double fraction) {
    ThrowIfInterrupted();
    progress.Update(fraction, fmt::format("loading {}", name));
  };
  try {
    Scene scene = LoadScene(name, options);
    ThrowIfInterrupted();
    return scene;
  } catch (const InputError&) {
    ThrowIfInterrupted();  // a reader reports as its own failure whatever it caught
    throw;
  }
}

}  // namespace raybench
