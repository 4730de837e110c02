// The shared ray-triangle tests on a whole block of triangles, for traversals that spend most of their time there:
// the same decisions to the bit as RayState (accel/ray/primitive.h), with the ray's constants spread over the lanes
// once, and without a branch on its main axis.
#pragma once

#include "accel/bvh/wide/rays.h"
#include "accel/contract/counting.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/ray/primitive.h"

namespace raybench {

/// Any test, also of procedural primitives.
template <class Test, bool kProcedural, int kLanes>
class SharedLeafTest {
 public:
  using Block = typename LeafBlocks<kLanes>::Block;
  SharedLeafTest(const RayQuery& q, const SlabRay4&, const rb_geometry& geometry)
      : geometry_(geometry), state_(q) {}

  template <bool kAnyHit>
  bool Take(const Block& block, rb_hit& best) const {
    NoCounting counter;
    return LeafBlocks<kLanes>::template IntersectBlocks<kProcedural, kAnyHit>(
        geometry_, &block, kLanes, state_, best, counter, NoMailbox{});
  }

 private:
  const rb_geometry& geometry_;
  RayState<Test> state_;
};

/// WatertightTest.
template <int kLanes>
class WatertightLeafTest {
  using F = FloatN<kLanes>;
  using I = IntN<kLanes>;
  using Double4 = Vec<double, 4>;
  static constexpr float kLeast = 0x1p-60f;

 public:
  using Block = typename LeafBlocks<kLanes>::Block;

  [[gnu::always_inline]] WatertightLeafTest(const RayQuery& q, const SlabRay4& slab,
                                            const rb_geometry&)
      : query_(q), slab_(slab) {
    const RayShear shear(q.ray);
    kx_ = unsigned(shear.kx), ky_ = unsigned(shear.ky), kz_ = unsigned(shear.kz);
    org_x_ = Splat<F>(q.ray.org[kx_]), org_y_ = Splat<F>(q.ray.org[ky_]), org_z_ = Splat<F>(q.ray.org[kz_]);
    sx_ = Splat<F>(shear.sx), sy_ = Splat<F>(shear.sy);
    dz_ = q.ray.dir[kz_];
    const auto flip = [&](unsigned axis) { return Splat<IntN<kLanes>>(int32_t(slab.signs >> axis & 1u) << 31); };
    flip_x_ = flip(kx_), flip_y_ = flip(ky_), flip_z_ = flip(kz_);
    const auto ordinary = [](float slope) { return std::fabs(slope) >= kLeast || slope == 0; };
    const bool all = ordinary(shear.sx) & ordinary(shear.sy);
    least_z_ = all ? kLeast : std::numeric_limits<float>::infinity();
    zero_z_ = all ? 0 : std::numeric_limits<float>::quiet_NaN();
  }

  template <bool kAnyHit>
  [[gnu::always_inline]] bool Take(const Block& block, rb_hit& best) const {
    // The registers belong to the node test: what is needed here stays in memory.
    const WatertightLeafTest* self = this;
    asm("" : "+r"(self));
    return self->template TakeBlock<kAnyHit>(block, best);
  }

 private:
  template <bool kAnyHit>
  [[gnu::always_inline]] bool TakeBlock(const Block& block, rb_hit& best) const {
    F x[3], y[3], z[3];
    for (int c = 0; c < 3; ++c) {
      z[c] = Load<F>(block.v[c][kz_]) - org_z_;
      x[c] = (Load<F>(block.v[c][kx_]) - org_x_) - sx_ * z[c];
      y[c] = (Load<F>(block.v[c][ky_]) - org_y_) - sy_ * z[c];
    }
    const F u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    const F tiny = Splat<F>(RayShear::kTiny);
    const F least = Smaller<kLanes>(u, Smaller<kLanes>(v, w)),
            most = Larger<kLanes>(u, Larger<kLanes>(v, w));
    unsigned candidates =
        ~(Less<kLanes>(least, -tiny) & Less<kLanes>(tiny, most)) & kAllLanes<kLanes>;
    if (candidates == 0) return false;
    if ((candidates & AnyBehind(z, flip_z_)) != 0) {
      const Block* again = &block;  // not kept in registers until here
      asm("" : "+r"(again));
      candidates &= ~Behind(*again, x, y, z, u, v, w, least + most);
      if (candidates == 0) return false;
    }
    Sheared s;
    for (int c = 0; c < 3; ++c) {
      std::memcpy(s.x[c], &x[c], sizeof x[c]);
      std::memcpy(s.y[c], &y[c], sizeof x[c]);
      std::memcpy(s.z[c], &z[c], sizeof x[c]);
    }
    bool changed = false;
    do {
      const int i = __builtin_ctz(candidates);
      candidates &= candidates - 1;
      changed |= Finish(block, s, i, best);
      if (kAnyHit && changed) return true;
    } while (candidates != 0);
    return changed;
  }

  /// Bit i: triangle i surely lies behind the origin: t < 0 and the box's near end < 0. Mostly the one that the ray
  /// starts from.
  [[gnu::always_inline]] unsigned Behind(const Block& block, const F (&x)[3], const F (&y)[3],
                                         const F (&z)[3], F u, F v, F w, F sum) const {
    F across = Abs(x[0]), along = Abs(z[0]), px[3], py[3];
    for (int c = 0; c < 3; ++c) {
      across = Larger<kLanes>(across, Larger<kLanes>(Abs(x[c]), Abs(y[c])));
      along = Larger<kLanes>(along, Abs(z[c]));
      px[c] = Load<F>(block.v[c][kx_]) - org_x_, py[c] = Load<F>(block.v[c][ky_]) - org_y_;
    }
    const F t = u * z[0] + v * z[1] + w * z[2];
    // Each of u, v, w errs by 2^-22.9 across^2.
    const F error = across * across * along * 0x1p-18f;
    return AnyBehind(px, flip_x_) & AnyBehind(py, flip_y_) & Less<kLanes>(error, Abs(t)) &
           Mask(F(I(t) ^ I(sum) ^ flip_z_));
  }
  [[gnu::always_inline]] static unsigned AnyBehind(const F (&d)[3], I flip) {
    return Mask(F((I(d[0]) ^ flip) | (I(d[1]) ^ flip) | (I(d[2]) ^ flip)));
  }

  struct Sheared {
    float x[3][kLanes], y[3][kLanes], z[3][kLanes];
  };

  /// As RayState<WatertightTest>::Triangle.
  [[gnu::always_inline]] bool Finish(const Block& block, const Sheared& s, int i, rb_hit& best) const {
    const Float4 x{s.x[0][i], s.x[1][i], s.x[2][i], 0}, y{s.y[0][i], s.y[1][i], s.y[2][i], 0};
    const Float4 zs{s.z[0][i], s.z[1][i], s.z[2][i], 1};
    // Where products with slopes may underflow, or slopes are NaN, vertices are sheared in double.
    if (Mask((Abs(zs) >= least_z_) | (zs == zero_z_)) != 15u) [[unlikely]]
      return FinishInDouble(query_, block, i, best);
    const auto shuffled = [](Float4 v, auto a, auto b, auto c) {
      return __builtin_convertvector(__builtin_shufflevector(v, v, a.value, b.value, c.value, 3), Double4);
    };
    constexpr std::integral_constant<int, 0> k0;
    constexpr std::integral_constant<int, 1> k1;
    constexpr std::integral_constant<int, 2> k2;
    // Exact products: u, v, w as in IntersectSheared.
    const Double4 e = shuffled(x, k2, k0, k1) * shuffled(y, k1, k2, k0) -
                      shuffled(y, k2, k0, k1) * shuffled(x, k1, k2, k0);
    const double u = e[0], v = e[1], w = e[2];
    if (((u < 0) | (v < 0) | (w < 0)) & ((u > 0) | (v > 0) | (w > 0))) return false;
    const double det = u + v + w;
    const double z0 = s.z[0][i], z1 = s.z[1][i], z2 = s.z[2][i];
    const double z = (u * z0 + v * z1 + w * z2) / det;
    const double t = z / double(dz_);
    if ((det == 0) | (std::fabs(z) < 0x1p-48 * (std::fabs(z0) + std::fabs(z1) + std::fabs(z2)))) [[unlikely]]
      return FinishInDouble(query_, block, i, best);
    Float4 p[3];
    for (int c = 0; c < 3; ++c) p[c] = Float4{block.v[c][0][i], block.v[c][1][i], block.v[c][2][i], 0};
    float tnear, tfar;
    slab_.PaddedInterval(p, tnear, tfar);
    const float clamped = std::min(std::max(float(t), tnear), tfar);
    const uint32_t prim = block.prim[i];
    if ((tnear > tfar) | !query_.Accepts(clamped, prim, best)) return false;
    best = {clamped, float(v / det), float(w / det), prim};
    return true;
  }

  [[gnu::noinline]] static bool FinishInDouble(const RayQuery& query, const Block& block, int i,
                                               rb_hit& best) {
    const RayState<WatertightTest> state(query);
    const auto corner = [&](int c) { return Vec3f{block.v[c][0][i], block.v[c][1][i], block.v[c][2][i]}; };
    return state.Triangle(corner(0), corner(1), corner(2), block.prim[i], best);
  }

  const RayQuery& query_;
  const SlabRay4& slab_;
  F org_x_, org_y_, org_z_, sx_, sy_;
  IntN<kLanes> flip_x_, flip_y_, flip_z_;  ///< the sign of the direction
  float dz_, least_z_, zero_z_;
  unsigned kx_, ky_, kz_;
};

}  // namespace raybench
