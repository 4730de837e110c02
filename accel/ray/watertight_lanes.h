// RayState<WatertightTest>::Triangle for some triangles at once, to the same decisions and the same bits: without a branch
// on the ray's main axis, and with all decisions in all lanes, those in double too.
#pragma once

#include <cmath>
#include <limits>

#include "accel/base/lanes.h"
#include "accel/contract/structure.h"
#include "accel/ray/bounds.h"
#include "accel/ray/triangle.h"

namespace raybench {

template <class Test>
struct RayState;

/// What a ray brings. Block: v[corner][axis][lane], prim[lane].
class WatertightLanes {
 public:
  [[gnu::always_inline]] WatertightLanes(const RayQuery& query, const SlabRay& slab, const RayShear& shear)
      : kx_(unsigned(shear.kx)), ky_(unsigned(shear.ky)), kz_(unsigned(shear.kz)) {
    const rb_ray& ray = query.ray;
    org_x_ = ray.org[kx_], org_y_ = ray.org[ky_], org_z_ = ray.org[kz_];
    sx_ = shear.sx, sy_ = shear.sy, dz_ = ray.dir[kz_];
    const auto sign = [&](unsigned axis) { return int32_t((slab.signs >> axis & 1) << 31); };
    sign_x_ = sign(kx_), sign_y_ = sign(ky_), sign_z_ = sign(kz_);
    // Products of slopes and z do not underflow where both are ordinary.
    const auto ordinary = [](float slope) { return std::fabs(slope) >= kLeast || slope == 0; };
    least_z_ = ordinary(sx_) & ordinary(sy_) ? kLeast : std::numeric_limits<float>::infinity();
    before_ = ray.tnear >= 0 && query.after == RAYBENCH_NONE ? ray.tnear * dz_
                                                             : std::numeric_limits<float>::quiet_NaN();
    reach_ = std::fabs(before_) + 0x1p-120f;
  }

  /// Takes triangles of the lanes in `asked` into `best`, of the query and the slab that this was made of. True if it
  /// changed; then kAnyHit returns at once.
  template <bool kAnyHit, class Block>
  [[gnu::always_inline]] bool Take(const Block& block, unsigned asked, const RayQuery& query,
                                   const SlabRay& slab, bool needs_uv, rb_hit& best) const {
    const unsigned candidates = Candidates<kAnyHit>(block, asked);
    return candidates != 0 && Decide<kAnyHit>(block, candidates, query, slab, needs_uv, best);
  }

  /// The first half of Take: the lanes in `asked` that float does not exclude.
  template <bool kAnyHit, class Block>
  [[gnu::always_inline]] unsigned Candidates(const Block& block, unsigned asked) const {
    constexpr int kLanes = LanesOf<Block>;
    using F = FloatN<kLanes>;
    const Sheared<kLanes> s = Shear(block);
    const F u = s.x[2] * s.y[1] - s.y[2] * s.x[1], v = s.x[0] * s.y[2] - s.y[0] * s.x[2],
            w = s.x[1] * s.y[0] - s.y[1] * s.x[0];
    // A non-zero difference of rounded products has the right sign.
    const F tiny = Splat<F>(RayShear::kTiny);
    const F least = Smaller<kLanes>(u, Smaller<kLanes>(v, w)), most = Larger<kLanes>(u, Larger<kLanes>(v, w));
    unsigned candidates = asked & ~(Less<kLanes>(least, -tiny) & Less<kLanes>(tiny, most));
    if (kAnyHit && candidates != 0) candidates &= ~Behind(block, s, u, v, w);
    return candidates;
  }

  /// The second half, for what the first one left, at least one lane: as RayState<WatertightTest>::Triangle.
  template <bool kAnyHit, class Block>
  [[gnu::always_inline]] bool Decide(const Block& block, unsigned candidates, const RayQuery& query,
                                     const SlabRay& slab, bool needs_uv, rb_hit& best) const {
    constexpr int kLanes = LanesOf<Block>;
    using F = FloatN<kLanes>;
    using I = IntN<kLanes>;
    using D = Vec<double, kLanes>;
    const auto mask_of = [](Vec<int64_t, kLanes> lanes) { return Mask(__builtin_convertvector(lanes, I)); };
    const Sheared<kLanes> s = Shear(block);
    const F least_z = Smaller<kLanes>(Abs(s.z[0]), Smaller<kLanes>(Abs(s.z[1]), Abs(s.z[2])));
    unsigned unusual = candidates & Less<kLanes>(least_z, Splat<F>(least_z_));
    // u, v, w of exact products, as in IntersectSheared.
    const D x0 = __builtin_convertvector(s.x[0], D), x1 = __builtin_convertvector(s.x[1], D),
            x2 = __builtin_convertvector(s.x[2], D), y0 = __builtin_convertvector(s.y[0], D),
            y1 = __builtin_convertvector(s.y[1], D), y2 = __builtin_convertvector(s.y[2], D),
            z0 = __builtin_convertvector(s.z[0], D), z1 = __builtin_convertvector(s.z[1], D),
            z2 = __builtin_convertvector(s.z[2], D);
    const D zero{};  // added, it makes +0 of -0, as there
    const D u = x2 * y1 - y2 * x1 + zero, v = x0 * y2 - y0 * x2 + zero, w = x1 * y0 - y1 * x0 + zero;
    const D det = u + v + w;
    const auto outside =
        (((u < zero) | (v < zero) | (w < zero)) & ((u > zero) | (v > zero) | (w > zero))) | (det == zero);
    const D z = (u * z0 + v * z1 + w * z2) / det;
    const D t = z / Splat<D>(dz_);
    const auto absolute = [](D d) { return D(Vec<int64_t, kLanes>(d) & 0x7FFFFFFFFFFFFFFF); };
    const auto in_plane = absolute(z) < 0x1p-48 * (absolute(z0) + absolute(z1) + absolute(z2));
    candidates &= ~mask_of(outside);
    unusual |= candidates & mask_of(in_plane);
    F tnear, tfar;
    Interval(block, slab, tnear, tfar);
    const F clamped = Smaller<kLanes>(tfar, Larger<kLanes>(tnear, __builtin_convertvector(t, F)));
    candidates &= LessEqual<kLanes>(tnear, tfar) & LessEqual<kLanes>(clamped, Splat<F>(best.t)) &
                  LessEqual<kLanes>(Splat<F>(query.ray.tnear), clamped) & ~unusual;
    bool changed = false;
    while (candidates != 0) {
      const int i = __builtin_ctz(candidates);
      candidates &= candidates - 1;
      const float ti = clamped[i];
      if (!query.Accepts(ti, block.prim[i], best)) continue;
      best = {ti, 0, 0, block.prim[i]};
      if (kAnyHit) return true;
      if (needs_uv) best.u = float(v[i] / det[i]), best.v = float(w[i] / det[i]);
      changed = true;
    }
    while (unusual != 0) [[unlikely]] {
        const int i = __builtin_ctz(unusual);
        unusual &= unusual - 1;
        changed |= TakeOne(query, block, i, best);
        if (kAnyHit && changed) return true;
      }
    return changed;
  }

 private:
  static constexpr float kLeast = 0x1p-60f;
  template <class Block>
  static constexpr int LanesOf = int(std::extent_v<decltype(Block::prim)>);

  template <int kLanes>
  struct Sheared {
    FloatN<kLanes> x[3], y[3], z[3];
  };

  template <class Block>
  [[gnu::always_inline]] Sheared<LanesOf<Block>> Shear(const Block& block) const {
    using F = FloatN<LanesOf<Block>>;
    Sheared<LanesOf<Block>> s;
    for (int c = 0; c < 3; ++c) {
      s.z[c] = Load<F>(block.v[c][kz_]) - Splat<F>(org_z_);
      s.x[c] = (Load<F>(block.v[c][kx_]) - Splat<F>(org_x_)) - Splat<F>(sx_) * s.z[c];
      s.y[c] = (Load<F>(block.v[c][ky_]) - Splat<F>(org_y_)) - Splat<F>(sy_) * s.z[c];
    }
    return s;
  }

  /// Lanes whose hit lies before tnear for sure, as that of the triangle does on which a secondary ray starts: in
  /// float, where Decide takes four times as long.
  ///
  /// Let u, v, w have one sign, that of d = u + v + w (else the ray passes the triangle, and nothing is lost). Then the hit is
  /// before tnear exactly if s (u z0 + v z1 + w z2 - T d) / d < 0 with T = tnear dz, s the sign of dz. With p = max |x| max |y|,
  /// float errs in u, v, w by 2^-22 p each, and in the sum by less than 2^-18 p (max |z| + |T|), fused or not, but for
  /// underflow, for which little is added. Decide's t is then below tnear by more than it errs, and clamped stays below it, since
  /// no side of the box that the ray enters by lies ahead of the origin. That takes tnear >= 0; T is NaN where this does not
  /// hold, or where a hit at tnear may count.
  template <class Block>
  [[gnu::always_inline]] unsigned Behind(const Block& block, const Sheared<LanesOf<Block>>& s,
                                         FloatN<LanesOf<Block>> u, FloatN<LanesOf<Block>> v,
                                         FloatN<LanesOf<Block>> w) const {
    constexpr int kLanes = LanesOf<Block>;
    using F = FloatN<kLanes>;
    using I = IntN<kLanes>;
    const auto most = [](const F(&of)[3]) {
      return LargerMagnitude<kLanes>(of[0], LargerMagnitude<kLanes>(of[1], of[2]));
    };
    const F p = most(s.x) * most(s.y) * 0x1p-18f;
    const F d = (u + v) + w;
    const F sum = MultiplyAdd<kLanes>(
        u, s.z[0], MultiplyAdd<kLanes>(v, s.z[1], MultiplyAdd<kLanes>(d, Splat<F>(-before_), w * s.z[2])));
    const I signed_sum = I(sum) ^ (I(d) & int32_t(0x80000000)) ^ sign_z_;
    const F error = MultiplyAdd<kLanes>(p, most(s.z) + Splat<F>(reach_), Splat<F>(0x1p-100f));
    const I begun = Begun(block, kx_, org_x_, sign_x_) & Begun(block, ky_, org_y_, sign_y_) &
                    Begun(block, kz_, org_z_, sign_z_);
    return Mask((F(signed_sum) < -error) & (p + RayShear::kTiny < Abs(d)) & begun);
  }

  /// Lanes, by their sign bits, whose triangle begins before the origin along the axis, in the ray's sense; one that begins
  /// there may be left out.
  template <class Block>
  [[gnu::always_inline]] static IntN<LanesOf<Block>> Begun(const Block& block, unsigned axis, float org,
                                                           int32_t sign) {
    constexpr int kLanes = LanesOf<Block>;
    using F = FloatN<kLanes>;
    using I = IntN<kLanes>;
    const auto from = [&](int corner) { return I(Load<F>(block.v[corner][axis]) - Splat<F>(org)) ^ sign; };
    return from(0) | from(1) | from(2);
  }

  /// Of PaddedBounds of the triangles, as SlabRay::Interval has it.
  template <class Block>
  [[gnu::always_inline]] static void Interval(const Block& block, const SlabRay& slab,
                                              FloatN<LanesOf<Block>>& tnear, FloatN<LanesOf<Block>>& tfar) {
    constexpr int kLanes = LanesOf<Block>;
    using F = FloatN<kLanes>;
    using I = IntN<kLanes>;
    F lo[3], hi[3];
    for (int a = 0; a < 3; ++a) {
      const F p0 = Load<F>(block.v[0][a]), p1 = Load<F>(block.v[1][a]), p2 = Load<F>(block.v[2][a]);
      lo[a] = Smaller<kLanes>(p0, Smaller<kLanes>(p1, p2)),
      hi[a] = Larger<kLanes>(p0, Larger<kLanes>(p1, p2));
    }
    const F extent = Larger<kLanes>(hi[0] - lo[0], Larger<kLanes>(hi[1] - lo[1], hi[2] - lo[2]));
    const F most = extent * kPadding, least = Splat<F>(std::numeric_limits<float>::denorm_min());
    constexpr float kInf = std::numeric_limits<float>::infinity();
    tnear = Splat<F>(-kInf), tfar = Splat<F>(kInf);
    for (int a = 0; a < 3; ++a) {
      const F pad = Larger<kLanes>((hi[a] - lo[a]) * kPadding + most, least);
      lo[a] = lo[a] - (pad + Abs(lo[a]) * kHalfUlp);
      hi[a] = hi[a] + (pad + Abs(hi[a]) * kHalfUlp);
      const I upper_first = Splat<I>(-int32_t(slab.negative(a)));
      const F first = upper_first ? hi[a] : lo[a], second = upper_first ? lo[a] : hi[a];
      tnear = Larger<kLanes>((first - Splat<F>(slab.org[a])) * Splat<F>(slab.inv_near[a]), tnear);
      tfar = Smaller<kLanes>((second - Splat<F>(slab.org[a])) * Splat<F>(slab.inv_far[a]), tfar);
    }
  }

  template <class Block, class State = RayState<WatertightTest>>
  [[gnu::noinline]] static bool TakeOne(const RayQuery& query, const Block& block, int i, rb_hit& best) {
    const State state(query);
    const auto corner = [&](int c) { return Vec3f{block.v[c][0][i], block.v[c][1][i], block.v[c][2][i]}; };
    return state.Triangle(corner(0), corner(1), corner(2), block.prim[i], best);
  }

  unsigned kx_, ky_, kz_;
  float org_x_, org_y_, org_z_, sx_, sy_, dz_, least_z_;
  float before_, reach_;  // tnear dz, NaN: nothing is before it; and |tnear dz|, for the error
  int32_t sign_x_, sign_y_, sign_z_;
};

}  // namespace raybench
