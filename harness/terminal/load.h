// Loading a scene for somebody who waits at a terminal.
#pragma once

#include <string>

#include "datasets/scene/scene.h"

namespace raybench {

/// LoadScene() with a progress display on stderr; nothing is shown for what takes no time. Throws InputError
/// as LoadScene() does, and InterruptedError soon after a Ctrl-C.
Scene LoadWithProgress(const std::string& name, LoadOptions options);

}  // namespace raybench
