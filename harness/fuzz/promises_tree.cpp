// What is promised of trees: sound nodes, the same each time, within the memory limit.
#include "accel/base/hash.h"
#include "harness/fuzz/examiner.h"
#include "harness/judge/tree_statistics.h"

namespace raybench::fuzz {
namespace {

/// Everything that a tree shows and answers, in a number.
uint64_t DigestOf(const Tree& tree) {
  Hash64 hash;
  if (tree.structure().visit == nullptr) return 0;
  tree.structure().visit(
      tree.get(),
      [](void* context, const rb_node* node) {
        Hash64& h = *static_cast<Hash64*>(context);
        for (uint32_t x : {node->depth, node->is_leaf, node->space_partition, node->shape, node->prim_count})
          h.AddValue(x);
        h.Add(node->bounds, node->bounds_count * sizeof(float));
        if (node->is_leaf) h.Add(node->prims, node->prim_count * sizeof(uint32_t));
        return 0;
      },
      &hash);
  return hash.value();
}

}  // namespace

Text Examiner::TreeIsSound() {
  if (result_.claim == RB_CLAIM_NOTHING) return std::nullopt;
  const auto statistics = ReadTree(tree_, geometry_);
  return statistics && !statistics->flaw.empty() ? Text(statistics->flaw) : std::nullopt;
}

Text Examiner::SameTreeOnThreads() {
  for (uint32_t threads : {2u, 3u})
    if (auto text = Rebuilt({.threads = threads}, threads == 2 ? "built on 2 threads" : "built on 3 threads"))
      return text;
  return std::nullopt;
}

Text Examiner::Rebuilt(How how, const char* what) {
  const Tree other = Build(how);
  if (DigestOf(tree_) != DigestOf(other)) return fmt::format("{}, it shows other nodes", what);
  for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
    Question q = All(kind);
    if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), Ask(other, q), what)) return text;
  }
  if (!Can(RB_CAN_COUNT)) return std::nullopt;
  Question q = All(RB_CLOSEST);
  q.counted = true;
  return CountsDiffer(Ask(tree_, q), Ask(other, q), what);
}

Text Examiner::FewerNeeds() {
  const Tree other = Build({.needs = RB_NEED_ANY});
  for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
    const Question q = All(kind);
    if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), Ask(other, q),
                               "built for fewer needs", /*with_uv=*/false))
      return text;
  }
  return std::nullopt;
}

uint64_t Examiner::BytesOf(const Tree& tree) {
  uint64_t nodes = 0, prims = 0;
  int needs_geometry = 0;
  tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
  return nodes + prims;
}

Text Examiner::KeepsMemoryLimit() {
  const uint64_t limit = BytesOf(tree_) / 2;
  if (limit == 0) return std::nullopt;
  try {
    const Tree other = Build({.memory_limit = limit});
    if (BytesOf(other) <= limit) return std::nullopt;
    return fmt::format("may take {} bytes, and builds a tree of {}", limit, BytesOf(other));
  } catch (const BuildError&) {
    return std::nullopt;
  }
}

}  // namespace raybench::fuzz
