#include "harness/truth/box_tree.h"

#include <algorithm>
#include <numeric>

namespace raybench {

BoxTree::BoxTree(const std::vector<Box>& boxes) : boxes_(boxes), items_(boxes.size()) {
  std::iota(items_.begin(), items_.end(), 0u);
  if (!items_.empty()) Split(0, uint32_t(items_.size()));
}

void BoxTree::Split(uint32_t first, uint32_t count) {
  constexpr uint32_t kLeaf = 4;
  Box box, middles;
  const auto middle = [&](uint32_t item) { return boxes_[item].lo + boxes_[item].hi; };
  for (uint32_t i = first; i < first + count; ++i) {
    box.Extend(boxes_[items_[i]]);
    middles.Extend(middle(items_[i]));
  }
  const size_t node = nodes_.size();
  nodes_.push_back({box, first, count});
  if (count <= kLeaf) return;
  const Vec3d size = middles.hi - middles.lo;
  const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  const auto begin = items_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](uint32_t a, uint32_t b) {
    const double x = middle(a)[axis], y = middle(b)[axis];
    return x != y ? x < y : a < b;
  });
  Split(first, count / 2);
  nodes_[node].count = 0;
  nodes_[node].first = uint32_t(nodes_.size());
  Split(first + count / 2, count - count / 2);
}

}  // namespace raybench
