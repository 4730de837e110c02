#include <atomic>

#include "tests/plugins/saboteurs/grid.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

/// Atomic, so that only its logic is wrong.
class SharedMailbox {
 public:
  SharedMailbox() {
    for (std::atomic<uint32_t>& slot : seen_) slot.store(RAYBENCH_NONE, std::memory_order_relaxed);
  }
  bool Seen(uint32_t prim) { return seen_[prim % 32].exchange(prim, std::memory_order_relaxed) == prim; }

 private:
  static inline std::atomic<uint32_t> seen_[32];
};

struct Fault : HonestGrid {
  static constexpr const char* kName = "shared_mailbox";
  static constexpr const char* kDoc =
      "one mailbox for all threads: what another ray was tested against is not tested";
  using Mailbox = SharedMailbox;
};

}  // namespace

RAYBENCH_PLUGIN(Grid<Fault>)
