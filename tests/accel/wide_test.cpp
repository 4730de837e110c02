// Wide BVHs: what nodes and rays promise one by one. That trees lose nothing is tested with the binary ones
// (bvh_test.cpp) and by the conformance tests.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include "accel/base/random.h"
#include "accel/bvh/binned_sah.h"
#include "accel/bvh/wide/collapse.h"
#include "accel/bvh/wide/compact_leaves.h"
#include "accel/bvh/wide/nodes.h"
#include "accel/bvh/wide/ray.h"
#include "accel/ray/bounds.h"
#include "tests/support/effort.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

/// Of any size from far below an ulp of its place to far beyond it; some are flat.
Bounds3 AnyBox(Random& random) {
  Bounds3 box;
  const float size = std::ldexp(1.0f, int(random.Below(50)) - 30),
              far = std::ldexp(1.0f, int(random.Below(50)) - 25);
  for (int a = 0; a < 3; ++a) {
    const float at = far * (random.NextFloat() - 0.5f);
    box.lo[a] = at, box.hi[a] = random.Below(4) == 0 ? at : at + size * random.NextFloat();
  }
  return box;
}

template <class Node, int kWidth>
void ExpectBoxesInside(Random& random) {
  Bounds3 boxes[kWidth];
  const size_t n = 1 + random.Below(kWidth);
  for (size_t i = 0; i < n; ++i) boxes[i] = AnyBox(random);
  Node node;
  node.SetBoxes({boxes, n});
  Bounds3 all;
  for (size_t i = 0; i < n; ++i) all.Extend(boxes[i]);
  for (int a = 0; a < 3; ++a) {
    const auto lo = node.Row(unsigned(a)), hi = node.Row(unsigned(a) + 3);
    for (size_t i = 0; i < n; ++i) {
      ASSERT_LE(lo[i], boxes[i].lo[a]);
      ASSERT_GE(hi[i], boxes[i].hi[a]);
      // No wider than two steps of a grid that is not too coarse, and a rounding.
      const float slack = (all.hi[a] - all.lo[a]) * 0x1p-5f +
                          0x1p-20f * std::max(std::fabs(all.lo[a]), std::fabs(all.hi[a])) + 0x1p-120f;
      ASSERT_GE(lo[i], boxes[i].lo[a] - slack);
      ASSERT_LE(hi[i], boxes[i].hi[a] + slack);
    }
    for (size_t i = n; i < kWidth; ++i) ASSERT_GE(lo[i], hi[i]);
  }
}

TEST(WideNodes, EncloseTheBoxesOfTheChildren) {
  Random random(5);
  for (int i = 0; i < 20000; ++i) {
    ExpectBoxesInside<FullNode<8>, 8>(random);
    ExpectBoxesInside<QuantizedNode<4, uint8_t>, 4>(random);
    ExpectBoxesInside<QuantizedNode<16, uint8_t>, 16>(random);
    ExpectBoxesInside<QuantizedNode<8, uint16_t>, 8>(random);
  }
}

TEST(WideNodes, QuantisedOnesAreSmall) {
  EXPECT_LE(sizeof(QuantizedNode<16, uint8_t>), 128u);  // two cache lines
  EXPECT_LE(double(sizeof(QuantizedNode<16, uint8_t>)) / sizeof(FullNode<16>), 0.45);
  EXPECT_LE(double(sizeof(QuantizedNode<8, uint8_t>)) / sizeof(FullNode<8>), 0.45);
}

template <int kWidth>
unsigned Meets(const FullNode<kWidth>& node, const rb_ray& ray, Slack slack, float tfar,
               FloatN<kWidth>& entry, bool& moved) {
  using F = FloatN<kWidth>;
  const SlabRay slab(ray, slack);
  const auto rows = [&](unsigned row) { return node.Row(row); };
  moved = MovedSlab::Fits(slab);
  return moved ? WideRay<kWidth, true>(slab).Meets(rows, Splat<F>(ray.tnear), Splat<F>(tfar), entry)
               : WideRay<kWidth, false>(slab).Meets(rows, Splat<F>(ray.tnear), Splat<F>(tfar), entry);
}

/// Whatever the shared test finds in a box is found in every box around it, from no later on.
TEST(WideRay, ContainsTheIntervalOfTheSharedTest) {
  Random random(6);
  size_t met = 0, all_moved = 0;
  for (int i = 0; i < 200000; ++i) {
    const Bounds3 inner = AnyBox(random);
    Bounds3 outer = inner;
    if (random.Below(2) == 0) outer.Extend(AnyBox(random));
    FullNode<8> node;
    node.SetBoxes({&outer, 1});
    rb_ray ray{};
    const float away = std::ldexp(1.0f, int(random.Below(40)) - 20);
    for (int a = 0; a < 3; ++a) {
      const float to = random.Below(3) == 0 ? inner.lo[a] : inner.hi[a];  // at corners
      ray.org[a] = to + away * (random.NextFloat() - 0.5f);
      ray.dir[a] = random.Below(8) == 0 ? 0.0f : to - ray.org[a];
    }
    if (ray.dir[0] == 0 && ray.dir[1] == 0 && ray.dir[2] == 0) continue;
    ray.tfar = INFINITY;
    for (const Slack slack : {Slack::kFarEnd, Slack::kBothEnds}) {
      float tnear, tfar;
      SlabRay(ray, slack).Interval(inner, tnear, tfar);
      if (!(std::max(tnear, 0.0f) <= tfar)) continue;
      ++met;
      FloatN<8> entry;
      bool moved;
      // Culled against a hit at the very end of the interval, or its beginning.
      for (const float best : {std::max(tnear, 0.0f), tfar}) {
        ASSERT_EQ(Meets<8>(node, ray, slack, best, entry, moved) & 1u, 1u) << i;
        ASSERT_LE(entry[0], std::max(tnear, 0.0f)) << i;
      }
      all_moved += moved;
    }
  }
  EXPECT_GT(met, 50000u);
  EXPECT_GT(all_moved, met / 4);
  EXPECT_LT(all_moved, met);
}

double HalfArea(const BuildNode& n) { return Bounds3{LoadVec3(n.lo), LoadVec3(n.hi)}.HalfArea(); }

/// The tree's cost times the root's area.
double CostOf(const BinaryTree& tree, const WideTopology& wide, const SahCosts& costs) {
  double sum = wide.nodes() > 0 ? costs.traversal * HalfArea(tree.nodes[0]) : 0;
  for (const WideTopology::Child& child : wide.children)
    sum += (child.count > 0 ? costs.Blocks(child.count) : costs.traversal) * HalfArea(tree.nodes[child.slot]);
  return sum;
}

uint32_t Count(const BinaryTree& tree, uint32_t slot) {
  const BuildNode& node = tree.nodes[slot];
  return node.count > 0 ? node.count : Count(tree, slot + 1) + Count(tree, node.right);
}

/// The cost where a node's largest child that is no leaf is opened as long as there is room.
double GreedyCost(const BinaryTree& tree, uint32_t slot, uint32_t width, const SahCosts& costs) {
  const auto is_leaf = [&](uint32_t s) {
    return tree.nodes[s].count > 0 || Count(tree, s) <= costs.leaf_size;
  };
  if (is_leaf(slot)) return costs.Blocks(Count(tree, slot)) * HalfArea(tree.nodes[slot]);
  std::vector<uint32_t> children{slot + 1, tree.nodes[slot].right};
  while (children.size() < width) {
    size_t best = children.size();
    for (size_t i = 0; i < children.size(); ++i)
      if (!is_leaf(children[i]) && (best == children.size() ||
                                    HalfArea(tree.nodes[children[i]]) > HalfArea(tree.nodes[children[best]])))
        best = i;
    if (best == children.size()) break;
    const uint32_t open = children[best];
    children[best] = open + 1;
    children.push_back(tree.nodes[open].right);
  }
  double sum = costs.traversal * HalfArea(tree.nodes[slot]);
  for (const uint32_t child : children) sum += GreedyCost(tree, child, width, costs);
  return sum;
}

TEST(Collapse, CostsNoMoreThanOpeningTheLargestChild) {
  for (const Mesh& mesh : {Ball(4), Lattice(20), Needles(2000)}) {
    const rb_geometry geometry = mesh.Geometry();
    for (const uint32_t width : {4u, 8u, 16u}) {
      const SahCosts costs{std::min(width, 8u), std::min(width, 8u), 1.0f};
      const BinaryTree tree = BuildBinnedSah(geometry, {16, {2, 2, 1.0f}, true}, nullptr);
      const WideTopology wide = Collapse(tree, width, costs);
      const double cost = CostOf(tree, wide, costs), greedy = GreedyCost(tree, 0, width, costs);
      EXPECT_LE(cost, greedy * 1.00001) << mesh.name << width;
      // On a lattice, all of whose boxes are alike, both find the same.
      EXPECT_TRUE(cost < 0.99 * greedy || mesh.name == Lattice(20).name) << mesh.name << width;
      std::vector<int> seen(mesh.triangles.size());
      for (uint32_t i = 0; i < wide.nodes(); ++i) {
        EXPECT_LE(wide.ChildrenOf(i).size(), width);
        EXPECT_GE(wide.ChildrenOf(i).size(), 2u);
      }
      for (const WideTopology::Child& child : wide.children)
        for (uint32_t k = 0; k < child.count; ++k) ++seen[tree.order[child.first + k]];
      EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), std::ptrdiff_t(seen.size()));
    }
  }
}

TEST(BvhWide, WithoutNeedOfUvTheRestIsTheSame) {
  const Mesh mesh = Ball(4);
  const rb_geometry geometry = mesh.Geometry();
  const Registry registry;
  rb_build_options options = DefaultBuildOptions();
  const auto rays = NastyRays(mesh, 2000, 3);
  const auto with = Closest(Build("bvh_wide", geometry), rays);
  options.needs = 0;
  const auto without = Closest(Tree(ParseContestant(registry, "bvh_wide"), geometry, options), rays);
  for (size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(with[i].prim, without[i].prim);
    ASSERT_EQ(with[i].t, without[i].t);
  }
}

/// Eight triangles of any shape and size, many of them edge-on or behind the origin, which often lies on one of them;
/// the interval begins or ends within a few ulp of a hit, or well off it.
TEST(BvhWide, AnyHitAgreesWithBruteAtTheEndsOfTheInterval) {
  Random random(8);
  size_t hits = 0, asked = 0;
  for (int i = 0; i < (kSanitized ? 2000 : 20000); ++i) {
    Mesh mesh{"eight", {}, {}};
    const float scale = std::ldexp(1.0f, int(random.Below(3)) * 40 - 40);
    const auto any = [&](float size) {
      Vec3f p;
      for (int a = 0; a < 3; ++a) p[a] = random.Below(6) == 0 ? 0.0f : size * (random.NextFloat() - 0.5f);
      return p;
    };
    for (uint32_t t = 0; t < 8; ++t) {
      const Vec3f at = any(scale);
      const float size = scale * std::ldexp(1.0f, -int(random.Below(12)));
      for (int c = 0; c < 3; ++c) mesh.positions.push_back(at + any(size));
      mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    const rb_geometry geometry = mesh.Geometry();
    const Tree brute = Build("brute", geometry), wide = Build("bvh_wide", geometry);
    std::vector<rb_ray> rays;
    for (int k = 0; k < 8; ++k) {
      const auto inside = [&] {  // of a triangle, or on its edge
        const size_t t = 3 * random.Below(8);
        const float u = random.NextFloat(), v = random.Below(4) == 0 ? 0.0f : 1 - u;
        return mesh.positions[t] * u + mesh.positions[t + 1] * v + mesh.positions[t + 2] * (1 - u - v);
      };
      const Vec3f from = random.Below(3) == 0 ? any(2 * scale) : inside(), to = inside();
      rb_ray ray{};
      for (int a = 0; a < 3; ++a) ray.org[a] = from[a], ray.dir[a] = to[a] - from[a];
      ray.tfar = INFINITY;
      rays.push_back(ray);
    }
    const std::vector<rb_hit> found = Closest(brute, rays);
    for (size_t k = 0, n = rays.size(); k < n; ++k) {
      if (found[k].prim == RAYBENCH_NONE) continue;
      const float t = found[k].t;
      for (const float near : {std::nextafter(t, 0.0f), t, std::nextafter(t, INFINITY), 1.001f * t}) {
        rays.push_back(rays[k]), rays.back().tnear = near;
      }
      rays.push_back(rays[k]), rays.back().tfar = t;
    }
    const std::vector<uint8_t> expected = Occluded(brute, rays), answers = Occluded(wide, rays);
    for (size_t k = 0; k < rays.size(); ++k) {
      ASSERT_EQ(answers[k], expected[k]) << i << ' ' << k;
      hits += answers[k], ++asked;
    }
  }
  EXPECT_GT(hits, asked / 3);
  EXPECT_LT(hits, asked - asked / 10);
}

/// What leaves of a form hold, three vertices a triangle, as the tree of bvh_wide(width=kWidth) has them.
template <int kWidth>
struct Held {
  static constexpr int kLanes = std::min(kWidth, 8);

  Mesh mesh{"held", {}, {}};
  std::vector<Bounds3> leaf;  ///< of each triangle, the original vertices of its leaf

  Held(const Mesh& of, Leaves form) {
    const rb_geometry geometry = of.Geometry();
    BinaryTree tree = BuildBinnedSah(geometry, {32, {kLanes, kLanes, 1.5f}, true}, nullptr);
    const WideTopology wide = Collapse(tree, kWidth, {kLanes, kLanes, 1.0f});
    const GridSteps steps = ChooseGrids(geometry, wide, form, tree);
    mesh.positions.resize(3 * of.triangles.size()), leaf.resize(of.triangles.size());
    for (uint32_t t = 0; t < of.triangles.size(); ++t)
      mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    const LeafCodec<kLanes>* codec = LeafCodec<kLanes>::Of(form);
    for (const WideTopology::Child& child : wide.children) {
      if (child.count == 0) continue;
      const std::span prims(&tree.order[child.first], child.count);
      std::vector<uint32_t> bytes(codec->bytes / 4 + 1);
      typename LeafBlocks<kLanes>::Block block;
      codec->encode(geometry, steps, prims, bytes.data());
      codec->decode(geometry, bytes.data(), block);
      Bounds3 box;
      for (const uint32_t prim : prims)
        for (int c = 0; c < 3; ++c) box.Extend(of.Corner(prim, c));
      for (uint32_t i = 0; i < uint32_t(kLanes); ++i) {
        const uint32_t prim = block.prim[i];
        EXPECT_EQ(prim, prims[std::min<size_t>(i, prims.size() - 1)]);
        leaf[prim] = box;
        for (uint32_t c = 0; c < 3; ++c)
          for (int a = 0; a < 3; ++a) mesh.positions[3 * prim + c][a] = block.v[c][a][i];
      }
    }
  }
};

/// Primitives that leaves hold whose triangle in `held` sticks out of the leaf's box, or of one around that.
size_t OutsideOfLeaves(const Tree& tree, const rb_geometry& held) {
  struct Context {
    const rb_geometry& held;
    size_t outside = 0;
  } context{held};
  tree.structure().visit(
      tree.get(),
      [](void* ctx, const rb_node* node) {
        const Bounds3 box{LoadVec3(node->bounds), LoadVec3(node->bounds + 3)};
        auto& [geometry, outside] = *static_cast<Context*>(ctx);
        for (uint32_t i = 0; i < node->prim_count; ++i)
          outside += !box.Contains(PaddedPrimBounds(geometry, node->prims[i]));
        return 0;
      },
      &context);
  return context.outside;
}

/// No lost hit, no other tie: traversal and boxes are right for the triangles that there are.
template <int kWidth>
void ExpectAnswersOfHeldTriangles(Leaves form, const std::string& nodes) {
  const Mesh meshes[] = {Mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5f}}, {{0, 1, 2}}},
                         Ball(4),
                         Lattice(10),
                         Coincident(100),
                         Needles(500),
                         Moved(Ball(3), 1, {1e6f, 1e6f, -1e6f}, "far"),
                         Moved(Ball(3), 0x1p-120f, {0, 0, 0}, "small"),
                         Moved(Needles(300), 0x1p-140f, {0, 0, 0}, "subnormal"),
                         Moved(Ball(3), 0x1p100f, {0, 0, 0}, "large")};
  size_t hits = 0, asked = 0, moved = 0;
  for (const Mesh& mesh : meshes) {
    const Held<kWidth> held(mesh, form);
    const std::string spec = "bvh_wide(width=" + std::to_string(kWidth) + ",nodes=" + nodes +
                             ",leaves=" + kLeafForms[size_t(form)] + ")";
    const Tree tree = Build(spec, mesh.Geometry()), brute = Build("brute", held.mesh.Geometry());
    EXPECT_EQ(OutsideOfLeaves(tree, held.mesh.Geometry()), 0u) << spec << ' ' << mesh.name;
    EXPECT_EQ(tree.Claims(), uint32_t(IsQuantized(form) ? RB_CLAIM_INEXACT : RB_CLAIM_WATERTIGHT));
    const auto rays = NastyRays(mesh, int(Effort(50)), 4);
    const auto got = Closest(tree, rays), expected = Closest(brute, rays);
    EXPECT_EQ(std::memcmp(got.data(), expected.data(), got.size() * sizeof(rb_hit)), 0)
        << spec << ' ' << mesh.name;
    EXPECT_EQ(Occluded(tree, rays), Occluded(brute, rays)) << spec << ' ' << mesh.name;
    for (const rb_hit& hit : got) hits += hit.prim != RAYBENCH_NONE;
    asked += got.size();
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
      for (int c = 0; c < 3; ++c) moved += !(held.mesh.Corner(t, c) == mesh.Corner(t, c));
  }
  EXPECT_GT(hits, asked / 4);
  EXPECT_EQ(moved > 1000, IsQuantized(form));
}

TEST(CompactLeaves, AreAnsweredAsTheTrianglesThatTheyHold) {
  ExpectAnswersOfHeldTriangles<8>(Leaves::kIndexed, "quantized8");
  ExpectAnswersOfHeldTriangles<4>(Leaves::kQuantized16, "quantized16");
  ExpectAnswersOfHeldTriangles<16>(Leaves::kQuantized8, "full");
  ExpectAnswersOfHeldTriangles<8>(Leaves::kSnapped16, "quantized8");
  ExpectAnswersOfHeldTriangles<4>(Leaves::kSnapped8, "full");
}

/// By half a step, which is at most the leaf's extent, or the largest leaf's, by the number of offsets; and in all leaves
/// alike where the step is common.
TEST(CompactLeaves, VerticesMoveByHalfAStepAndStayTogetherWhereTheStepIsCommon) {
  for (const Mesh& mesh : {Ball(4), Moved(Ball(4), 1, {100, 0, -3}, "off"), Needles(500)}) {
    for (const Leaves form : {Leaves::kIndexed, Leaves::kQuantized16, Leaves::kQuantized8, Leaves::kSnapped16,
                              Leaves::kSnapped8}) {
      const bool is_common = form == Leaves::kSnapped16 || form == Leaves::kSnapped8;
      const float offsets = form == Leaves::kQuantized8 || form == Leaves::kSnapped8 ? 255 : 65535;
      const Held<8> held(mesh, form);
      Vec3f largest{0, 0, 0};
      for (const Bounds3& box : held.leaf) largest = Max(largest, box.Extent());
      std::map<uint32_t, Vec3f> place;
      size_t torn = 0;
      for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        for (int c = 0; c < 3; ++c) {
          const Vec3f from = mesh.Corner(t, c), to = held.mesh.Corner(t, c);
          const Vec3f extent = is_common ? largest : held.leaf[t].Extent();
          for (int a = 0; a < 3; ++a) {
            ASSERT_TRUE(IsQuantized(form) || from[a] == to[a]);
            ASSERT_LE(std::fabs(from[a] - to[a]), 1.02f * extent[a] / offsets) << kLeafForms[size_t(form)];
          }
          torn += !(place.try_emplace(mesh.triangles[t][size_t(c)], to).first->second == to);
        }
      }
      EXPECT_EQ(torn > 0, IsQuantized(form) && !is_common && mesh.name != Needles(1).name)
          << kLeafForms[size_t(form)] << ' ' << mesh.name;
    }
  }
}

TEST(CompactLeaves, TakeLessMemoryAndSayWhatTheyRead) {
  const Mesh mesh = Ball(5);
  const rb_geometry geometry = mesh.Geometry();
  uint64_t before = ~uint64_t{0};
  for (const std::string form : {"copied", "quantized16", "snapped8", "indexed"}) {
    const Tree tree = Build("bvh_wide(width=8,leaves=" + form + ")", geometry);
    uint64_t nodes = 0, prims = 0;
    int needs_geometry = 0;
    tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
    EXPECT_LT(prims, before) << form;
    EXPECT_EQ(needs_geometry, form == "indexed");
    before = prims;
  }
}

TEST(CompactLeaves, RefuseWhatTheyCannotHold) {
  const Mesh mesh = Ball(1);
  const Balls balls(2, 4);
  const auto why = [](const std::string& spec, const rb_geometry& geometry) -> std::string {
    try {
      Build(spec, geometry);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  };
  for (const std::string form : {"quantized16", "quantized8", "snapped16", "snapped8"}) {
    const std::string spec = "bvh_wide(leaves=" + form;
    EXPECT_NE(why(spec + ",builder=spatial)", mesh.Geometry()).find("allowed: binned, sweep, morton"),
              std::string::npos);
    EXPECT_NE(why(spec + ")", balls.Geometry(mesh)).find("allowed: copied, indexed"), std::string::npos);
    EXPECT_EQ(why(spec + ",builder=morton)", mesh.Geometry()), "");
  }
}

/// Rays of a query with all that comes with them.
struct Asked {
  std::vector<rb_ray> rays;
  std::vector<uint32_t> skip, after;

  void Add(const rb_ray& ray, uint32_t skipped = RAYBENCH_NONE, uint32_t behind = RAYBENCH_NONE) {
    rays.push_back(ray), skip.push_back(skipped), after.push_back(behind);
  }
};

/// The ray changed, or with what comes with it: such as ends or resumes at a hit, skips one, starts far off, is nearly
/// parallel to an axis or invalid.
void AddVariant(Asked& all, rb_ray ray, const rb_hit& hit, Random& random) {
  const size_t axis = random.Below(3);
  switch (random.Below(6)) {
    case 0:
      ray.tfar = hit.t;
      return all.Add(ray);
    case 1:
      ray.tnear = std::isfinite(hit.t) ? hit.t : 0.5f;
      return all.Add(ray, RAYBENCH_NONE, hit.prim);
    case 2:
      return all.Add(ray, hit.prim);
    case 3:
      ray.dir[axis] *= 0x1p-80f;  // does not fit MovedSlab
      return all.Add(ray);
    case 4:
      ray.dir[axis] = NAN;
      return all.Add(ray);
    default:
      ray.org[axis] += 1e6f;
      return all.Add(ray);
  }
}

/// Nasty rays, each with a variant; then neighbours as of a picture, one in eight of them a variant.
Asked Everything(const Mesh& mesh, const Tree& tree) {
  Asked all;
  Random random(12);
  for (const rb_ray& ray : NastyRays(mesh, int(Effort(100)), 9)) {
    all.Add(ray);
    AddVariant(all, ray, Closest(tree, {ray})[0], random);
  }
  Bounds3 box = BoundsOf(mesh);
  if (box.Empty()) box = {{-1, -1, -1}, {1, 1, 1}};
  const Vec3f size = box.Extent();
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 24; ++x) {
      // The eye stands off a corner, and moves a little.
      const Vec3f eye = box.hi + size * (0.7f + 0.001f * random.NextFloat()),
                  to = {box.lo.x + size.x * float(x) / 24, box.lo.y + size.y * float(y) / 24, box.lo.z},
                  d = to - eye;
      const rb_ray ray{{eye.x, eye.y, eye.z}, 0, {d.x, d.y, d.z}, INFINITY};
      if (random.Below(8) == 0) {
        AddVariant(all, ray, Closest(tree, {ray})[0], random);
      } else {
        all.Add(ray);
      }
    }
  }
  return all;
}

struct Said {
  std::vector<rb_hit> hits;
  std::vector<uint8_t> occluded;
  std::vector<rb_counts> counts;

  bool operator==(const Said& other) const {
    const auto same = [](const auto& a, const auto& b) {
      return a.size() == b.size() &&
             (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0);
    };
    return same(hits, other.hits) && same(occluded, other.occluded) && same(counts, other.counts);
  }
};

/// Answers in calls of `batch` rays, and one of none.
Said Ask(const Tree& tree, const Asked& asked, size_t batch, bool extras, bool counted) {
  const size_t n = asked.rays.size();
  Said said{std::vector<rb_hit>(n, rb_hit{-1, -1, -1, 7}), std::vector<uint8_t>(n, 7),
            std::vector<rb_counts>(counted ? n : 0)};
  for (const uint32_t kind : {RB_CLOSEST, RB_ANY}) {
    for (size_t i = 0;; i += batch) {
      rb_query q{};
      q.struct_size = sizeof q, q.kind = kind, q.n = i < n ? std::min(batch, n - i) : 0;
      q.rays = asked.rays.data() + i, q.hits = said.hits.data() + i, q.occluded = said.occluded.data() + i;
      if (extras) q.skip = asked.skip.data() + i, q.after = asked.after.data() + i;
      if (counted) q.counts = said.counts.data() + i;
      counted ? tree.QueryCounted(q) : tree.Query(q);
      if (q.n == 0) break;
    }
  }
  return said;
}

TEST(BvhWide, BatchesAreAnsweredAsSingleRays) {
  const char* const kForms[] = {"width=16",
                                "width=8,nodes=quantized8,builder=spatial",
                                "width=4,nodes=quantized16",
                                "width=16,nodes=quantized8,builder=spatial",
                                "width=8",
                                "width=4,numerics=fast",
                                "width=16,nodes=quantized16,numerics=exact"};
  const Mesh meshes[] = {Mesh{"empty", {}, {}},
                         Mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5f}}, {{0, 1, 2}}},
                         Ball(4),
                         Lattice(10),
                         Coincident(100),
                         Needles(500),
                         Moved(Ball(3), 1, {1e6f, 1e6f, -1e6f}, "far"),
                         Moved(Ball(3), 0x1p-100f, {0, 0, 0}, "small")};
  const Balls balls(20, 4);
  size_t hits = 0, asked_for = 0;
  for (const std::string form : kForms) {
    for (const Mesh& mesh : meshes) {
      for (const bool has_balls : {false, true}) {
        if (has_balls && mesh.name != "ball") continue;
        const rb_geometry geometry = has_balls ? balls.Geometry(mesh) : mesh.Geometry();
        const Tree single = Build("bvh_wide(" + form + ")", geometry);
        const Asked asked = Everything(mesh, single);
        const size_t n = asked.rays.size();
        for (const std::string batch : {"interleaved", "packet"}) {
          const Tree several = Build("bvh_wide(batch=" + batch + "," + form + ")", geometry);
          for (const bool extras : {false, true}) {
            const Said expected = Ask(single, asked, n, extras, false);
            for (const size_t size : {size_t{1}, size_t{7}, size_t{17}, n})
              ASSERT_TRUE(Ask(several, asked, size, extras, false) == expected)
                  << batch << ' ' << form << ' ' << mesh.name << ' ' << size << ' ' << extras;
            for (const rb_hit& hit : expected.hits) hits += hit.prim != RAYBENCH_NONE;
            asked_for += n;
          }
          ASSERT_TRUE(Ask(several, asked, 7, true, true) == Ask(single, asked, n, true, true))
              << batch << ' ' << form << ' ' << mesh.name;
        }
      }
    }
  }
  EXPECT_GT(hits, asked_for / 3);
  EXPECT_LT(hits, asked_for - asked_for / 10);
}

TEST(CompactLeaves, IndexedOnesAreAnsweredAsCopiedOnes) {
  const Mesh mesh = Ball(4);
  const Balls balls(20, 4);
  for (const std::string form :
       {"width=4", "width=8,numerics=fast", "width=16,numerics=exact,nodes=quantized8"}) {
    for (const rb_geometry& geometry : {mesh.Geometry(), balls.Geometry(mesh)}) {
      const Tree copied = Build("bvh_wide(" + form + ")", geometry),
                 indexed = Build("bvh_wide(leaves=indexed,batch=packet," + form + ")", geometry);
      const Asked asked = Everything(mesh, copied);
      const size_t n = asked.rays.size();
      Said with = Ask(copied, asked, n, true, false), without = Ask(indexed, asked, n, true, false);
      ASSERT_TRUE(with == without) << form;
      with = Ask(copied, asked, n, true, true), without = Ask(indexed, asked, n, true, true);
      uint64_t bytes[2] = {};
      for (size_t i = 0; i < n; ++i) {
        bytes[0] += std::exchange(with.counts[i].bytes, 0),
            bytes[1] += std::exchange(without.counts[i].bytes, 0);
      }
      ASSERT_TRUE(with == without) << form;
      EXPECT_NE(bytes[0], bytes[1]);
    }
  }
}

}  // namespace
}  // namespace raybench::testing
