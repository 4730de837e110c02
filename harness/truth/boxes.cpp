// The oracle of a build without CGAL: exact signs and exact order for all primitives, candidates from a plain
// tree of boxes.
#include "harness/truth/verdict.h"

namespace raybench {
namespace {

class BoxOracle final : public JudgingOracle {
 public:
  explicit BoxOracle(const Scene& scene) : JudgingOracle(scene, 0) {}
  std::string Name() const override { return "tree of boxes (exact signs and order)"; }
};

}  // namespace

std::unique_ptr<Oracle> MakeBoxOracle(const Scene& scene) { return std::make_unique<BoxOracle>(scene); }

}  // namespace raybench
