#include "accel/space/center_tree.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "accel/base/parallel.h"
#include "accel/contract/cancel.h"

namespace raybench {
namespace {

constexpr size_t kChunk = 4096;

class Builder {
 public:
  Builder(const Insertion& insertion, const CenterTreeOptions& tree, const rb_build_options& options)
      : insertion_(insertion), options_(tree), build_(options), children_(1u << tree.axis_count) {}

  CenterTree Take() {
    result_.children = children_;
    result_.nodes.push_back({insertion_.Scene()});
    refs_.resize(insertion_.size());
    std::iota(refs_.begin(), refs_.end(), 0u);
    std::vector<Open> open{{0, 0, refs_.size()}};
    for (uint32_t depth = 0; !open.empty(); ++depth) open = Level(open, depth);
    return std::move(result_);
  }

 private:
  /// A cell to be looked at, its references in refs_.
  struct Open {
    uint32_t node;
    size_t begin, end;
    float center[3] = {};
    uint64_t into[8] = {};  // references of its children, then where they begin in next_
    bool divided = false;
  };
  struct Chunk {
    uint32_t open;
    size_t begin, end;
    uint64_t into[8] = {};
    float lo[8] = {}, hi[8] = {};  // of its primitives' boxes along the axis that is not halved
  };

  std::vector<Open> Level(std::vector<Open>& open, uint32_t depth) {
    std::vector<Chunk> chunks;
    for (uint32_t i = 0; i < open.size(); ++i) {
      Open& o = open[i];
      const Bounds3& box = result_.nodes[o.node].box;
      bool divisible = false;
      for (int k = 0; k < options_.axis_count; ++k) {
        const int a = options_.axes[k];
        o.center[k] = CenterOf(box, a);
        divisible = divisible || o.center[k] < box.hi[a];
      }
      o.divided = o.end - o.begin > options_.leaf_size && depth < options_.depth && divisible;
      if (!o.divided) continue;
      for (size_t begin = o.begin; begin < o.end; begin += kChunk)
        chunks.push_back({i, begin, std::min(begin + kChunk, o.end)});
    }
    masks_.resize(refs_.size());
    ParallelFor(size_t{0}, chunks.size(), [&](size_t c) {
      CheckCancel(build_.cancel);
      Look(open[chunks[c].open], chunks[c]);
    });

    for (const Chunk& chunk : chunks) {
      for (uint32_t k = 0; k < children_; ++k) open[chunk.open].into[k] += chunk.into[k];
    }
    Choose(open);
    // Give the children their places.
    std::vector<Open> below;
    uint64_t next = 0;
    for (Open& o : open) {
      const size_t held = o.end - o.begin;
      CenterTree::Node& node = result_.nodes[o.node];
      if (!o.divided) {
        node.first = result_.refs.size();
        node.count = uint32_t(held);
        result_.refs.insert(result_.refs.end(), refs_.begin() + ptrdiff_t(o.begin),
                            refs_.begin() + ptrdiff_t(o.end));
        blocks_ += LeafBlocks<>::BlocksOf(held);
        continue;
      }
      const auto child = uint32_t(result_.nodes.size());
      node.child = child;
      const Bounds3 box = node.box;  // adding nodes moves them
      for (uint32_t k = 0; k < children_; ++k) {
        result_.nodes.push_back({ChildBox(box, o.center, k)});
        const uint64_t n = o.into[k];
        o.into[k] = next;
        if (n > 0) below.push_back({child + k, next, next + n});
        next += n;
      }
    }
    Account(next);

    for (size_t c = 0; c < chunks.size(); ++c) {
      Open& o = open[chunks[c].open];
      if (!o.divided) continue;
      for (uint32_t k = 0; k < children_; ++k) {
        const uint64_t n = chunks[c].into[k];
        chunks[c].into[k] = o.into[k];
        o.into[k] += n;
        if (n > 0 && options_.axis_count == 2) {
          Bounds3& box = result_.nodes[result_.nodes[o.node].child + k].box;
          float& lo = box.lo[options_.axes[2]];
          float& hi = box.hi[options_.axes[2]];
          lo = std::min(lo, chunks[c].lo[k]);
          hi = std::max(hi, chunks[c].hi[k]);
        }
      }
    }
    next_.resize(next);
    ParallelFor(size_t{0}, chunks.size(), [&](size_t c) {
      Chunk& chunk = chunks[c];
      if (!open[chunk.open].divided) return;
      for (size_t i = chunk.begin; i < chunk.end; ++i) {
        for (unsigned mask = masks_[i]; mask != 0; mask &= mask - 1)
          next_[chunk.into[__builtin_ctz(mask)]++] = refs_[i];
      }
    });
    refs_.swap(next_);
    return below;
  }

  /// Which of the cells that may be divided are.
  void Choose(std::vector<Open>& open) const {
    struct Growth {
      double factor;
      uint64_t more;
      Open* cell;
    };
    std::vector<Growth> growths;
    uint64_t total = result_.refs.size() + refs_.size();
    for (Open& o : open) {
      const auto held = double(o.end - o.begin);
      const uint64_t spread = std::accumulate(o.into, o.into + children_, uint64_t{0});
      o.divided = o.divided && double(spread) < options_.growth * held;
      if (!o.divided) continue;
      growths.push_back({double(spread) / held, spread - (o.end - o.begin), &o});
      total += growths.back().more;
    }
    const double most = options_.references * double(insertion_.size());
    if (double(total) <= most) return;
    std::stable_sort(growths.begin(), growths.end(), [](auto& a, auto& b) { return a.factor > b.factor; });
    for (size_t i = 0; i < growths.size() && double(total) > most; ++i) {
      growths[i].cell->divided = false;
      total -= growths[i].more;
    }
  }

  /// Along an axis that is not halved: empty, until its primitives are known.
  Bounds3 ChildBox(Bounds3 box, const float (&center)[3], uint32_t child) const {
    for (int k = 0; k < options_.axis_count; ++k)
      ((child >> k & 1) != 0 ? box.lo : box.hi)[options_.axes[k]] = center[k];
    if (options_.axis_count == 2) {
      const Bounds3 none;
      box.lo[options_.axes[2]] = none.lo.x;
      box.hi[options_.axes[2]] = none.hi.x;
    }
    return box;
  }

  void Look(const Open& o, Chunk& chunk) {
    const Bounds3 box = result_.nodes[o.node].box;
    const unsigned all = (1u << children_) - 1;
    static constexpr unsigned kUpper[3] = {0xAA, 0xCC, 0xF0};  // children in the upper half along axis k
    for (uint32_t k = 0; k < children_; ++k) {
      chunk.lo[k] = Bounds3{}.lo.x;
      chunk.hi[k] = Bounds3{}.hi.x;
    }
    for (size_t i = chunk.begin; i < chunk.end; ++i) {
      const uint32_t prim = refs_[i];
      const Bounds3& b = insertion_.Box(prim);
      unsigned mask = all;
      for (int k = 0; k < options_.axis_count; ++k) {
        const int a = options_.axes[k];
        const float c = o.center[k];
        bool lower = b.lo[a] <= c, upper = b.hi[a] >= c;  // both halves own the plane
        if (c >= box.hi[a]) {
          // Too thin to be halved.
          lower = true;
          upper = false;
        }
        if (!lower) mask &= kUpper[k];
        if (!upper) mask &= ~kUpper[k];
      }
      if (insertion_.IsExact(prim) && (mask & (mask - 1)) != 0) mask = Meets(prim, box, o.center, mask);
      masks_[i] = uint8_t(mask);
      for (unsigned m = mask; m != 0; m &= m - 1) {
        const int k = __builtin_ctz(m);
        ++chunk.into[k];
        if (options_.axis_count == 2) {
          chunk.lo[k] = std::min(chunk.lo[k], b.lo[options_.axes[2]]);
          chunk.hi[k] = std::max(chunk.hi[k], b.hi[options_.axes[2]]);
        }
      }
    }
  }

  /// Those of the children that the triangle itself meets; never none, lest rounding lose it.
  unsigned Meets(uint32_t prim, const Bounds3& box, const float (&center)[3], unsigned mask) const {
    unsigned result = 0;
    for (unsigned m = mask; m != 0; m &= m - 1) {
      const auto child = uint32_t(__builtin_ctz(m));
      Bounds3 cell = ChildBox(box, center, child);
      if (options_.axis_count == 2) {
        const int height = options_.axes[2];
        cell.lo[height] = insertion_.Box(prim).lo[height];
        cell.hi[height] = insertion_.Box(prim).hi[height];
      }
      if (insertion_.TriangleMeets(prim, ToDouble(cell.lo), ToDouble(cell.hi))) result |= 1u << child;
    }
    return result != 0 ? result : mask;
  }

  void Account(uint64_t open_refs) const {
    const uint64_t refs = result_.refs.size() + open_refs;
    if (refs >= (uint64_t{1} << 32) || result_.nodes.size() >= (uint64_t{1} << 31))
      throw std::runtime_error("more than 2^32 references: lower depth or growth");
    const uint64_t bytes = insertion_.bytes() + result_.nodes.size() * (sizeof(CenterTree::Node) + 64) +
                           (refs_.size() + refs) * sizeof(uint32_t) + masks_.size() +
                           (blocks_ + LeafBlocks<>::BlocksOf(open_refs)) * sizeof(LeafBlocks<>::Block);
    RequireWithinLimit(bytes, build_);
  }

  const Insertion& insertion_;
  const CenterTreeOptions& options_;
  const rb_build_options& build_;
  const uint32_t children_;
  CenterTree result_;
  std::vector<uint32_t> refs_, next_;
  std::vector<uint8_t> masks_;
  uint64_t blocks_ = 0;
};

}  // namespace

CenterTree BuildCenterTree(const Insertion& insertion, const CenterTreeOptions& tree,
                           const rb_build_options& options) {
  return Builder(insertion, tree, options).Take();
}

CenterLeaves::CenterLeaves(const rb_geometry& geometry, const CenterTree& tree)
    : children_(tree.nodes.size()) {
  std::vector<uint32_t> leaves, stack{0};
  size_t blocks = 0;
  while (!stack.empty()) {
    const uint32_t slot = stack.back();
    stack.pop_back();
    const CenterTree::Node& node = tree.nodes[slot];
    if (!node.IsLeaf()) {
      children_[slot] = {uint32_t(inner_.size()), CenterChild::kInner};
      inner_.push_back(slot);
      for (uint32_t k = tree.children; k-- > 0;) stack.push_back(node.child + k);
    } else if (node.count > 0) {
      const Leaf leaf{uint32_t(blocks), node.count};
      if (node.count <= CenterChild::kMostCounted) {
        children_[slot] = {leaf.block, uint16_t(node.count)};
      } else {
        children_[slot] = {uint32_t(large_.size()), CenterChild::kLarge};
        large_.push_back(leaf);
      }
      leaves.push_back(slot);
      blocks += LeafBlocks<>::BlocksOf(node.count);
    }
  }
  blocks_ = LeafBlocks<>(geometry, blocks);
  ParallelFor(Range<size_t>(0, leaves.size(), 1024), [&](const auto& range) {
    blocks_.Fill(range.begin(), range.end(), [&](size_t i) {
      const CenterTree::Node& node = tree.nodes[leaves[i]];
      return std::pair(Of(children_[leaves[i]]).block, std::span(tree.refs).subspan(node.first, node.count));
    });
  });
}

}  // namespace raybench
