// How traversal tests leaves: a block of triangles in all lanes at once, to the same decisions and the same bits as
// RayState (accel/ray/primitive.h), without a branch on the ray's main axis.
#pragma once

#include <limits>

#include "accel/bvh/wide/ray.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/ray/primitive.h"

namespace raybench {

/// Whatever is asked seldom, as a call: any test, also of procedural primitives.
template <int kLanes>
class CalledLeafTest {
 public:
  using Block = typename LeafBlocks<kLanes>::Block;

  template <class Test>
  CalledLeafTest(const RayState<Test>& state, const rb_geometry& geometry)
      : state_(&state),
        geometry_(geometry),
        closest_(geometry.procedural_count > 0 ? &Call<Test, true, false> : &Call<Test, false, false>),
        any_(geometry.procedural_count > 0 ? &Call<Test, true, true> : &Call<Test, false, true>) {}

  template <bool kAnyHit>
  bool Take(const Block& block, rb_hit& best) const {
    return (kAnyHit ? any_ : closest_)(state_, geometry_, block, best);
  }

 private:
  using Function = bool (*)(const void* state, const rb_geometry&, const Block&, rb_hit&);

  template <class Test, bool kProcedural, bool kAnyHit>
  static bool Call(const void* state, const rb_geometry& geometry, const Block& block, rb_hit& best) {
    NoCounting counted;
    return LeafBlocks<kLanes>::template IntersectBlocks<kProcedural, kAnyHit>(
        geometry, &block, kLanes, *static_cast<const RayState<Test>*>(state), best, counted, NoMailbox{});
  }

  const void* state_;
  const rb_geometry& geometry_;
  Function closest_, any_;
};

/// WatertightTest. All decisions are taken in all lanes, those in double too.
template <int kLanes>
class WatertightLeafTest {
  using F = FloatN<kLanes>;
  using I = IntN<kLanes>;
  using D = Vec<double, kLanes>;
  static constexpr float kLeast = 0x1p-60f;

 public:
  using Block = typename LeafBlocks<kLanes>::Block;

  [[gnu::always_inline]] WatertightLeafTest(const RayQuery& q, const SlabRay4& slab, bool needs_uv)
      : query_(q), slab_(slab), needs_uv_(needs_uv) {
    const RayShear shear(q.ray);
    kx_ = unsigned(shear.kx), ky_ = unsigned(shear.ky), kz_ = unsigned(shear.kz);
    org_x_ = q.ray.org[kx_], org_y_ = q.ray.org[ky_], org_z_ = q.ray.org[kz_];
    sx_ = shear.sx, sy_ = shear.sy, dz_ = q.ray.dir[kz_];
    // Products of slopes and z do not underflow where both are ordinary.
    const auto ordinary = [](float slope) { return std::fabs(slope) >= kLeast || slope == 0; };
    const auto sign = [&](unsigned axis) { return int32_t((slab.signs >> axis & 1) << 31); };
    sign_x_ = sign(kx_), sign_y_ = sign(ky_), sign_z_ = sign(kz_);
    before_ = q.ray.tnear >= 0 && q.after == RAYBENCH_NONE ? q.ray.tnear * dz_
                                                           : std::numeric_limits<float>::quiet_NaN();
    least_z_ = ordinary(sx_) & ordinary(sy_) ? kLeast : std::numeric_limits<float>::infinity();
  }

  template <bool kAnyHit>
  [[gnu::always_inline]] bool Take(const Block& block, rb_hit& best) const {
    // The registers belong to the node test: what is needed here stays in memory.
    const WatertightLeafTest* self = this;
    asm("" : "+r"(self));
    return self->template TakeBlock<kAnyHit>(block, best);
  }

 private:
  struct Sheared {
    F x[3], y[3], z[3];
  };

  [[gnu::always_inline]] Sheared Shear(const Block& block) const {
    Sheared s;
    for (int c = 0; c < 3; ++c) {
      s.z[c] = Load<F>(block.v[c][kz_]) - Splat<F>(org_z_);
      s.x[c] = (Load<F>(block.v[c][kx_]) - Splat<F>(org_x_)) - Splat<F>(sx_) * s.z[c];
      s.y[c] = (Load<F>(block.v[c][ky_]) - Splat<F>(org_y_)) - Splat<F>(sy_) * s.z[c];
    }
    return s;
  }

  template <bool kAnyHit>
  [[gnu::always_inline]] bool TakeBlock(const Block& block, rb_hit& best) const {
    const Sheared s = Shear(block);
    const F u = s.x[2] * s.y[1] - s.y[2] * s.x[1], v = s.x[0] * s.y[2] - s.y[0] * s.x[2],
            w = s.x[1] * s.y[0] - s.y[1] * s.x[0];
    const F tiny = Splat<F>(RayShear::kTiny);
    const F least = Smaller<kLanes>(u, Smaller<kLanes>(v, w)), most = Larger<kLanes>(u, Larger<kLanes>(v, w));
    unsigned candidates = ~(Less<kLanes>(least, -tiny) & Less<kLanes>(tiny, most)) & kAllLanes<kLanes>;
    if (candidates == 0) return false;
    if (kAnyHit) {
      candidates &= ~Behind(block, s, u, v, w);
      if (candidates == 0) return false;
    }
    return Decide<kAnyHit>(block, candidates, best);
  }

  /// Lanes whose hit lies before tnear for sure, as that of the triangle does on which a secondary ray starts: in
  /// float, where Decide takes four times as long.
  ///
  /// Let u, v, w have one sign, that of d = u + v + w (else the ray passes the triangle, and nothing is lost). Then
  /// the hit is before tnear exactly if s (u (z0 - T) + v (z1 - T) + w (z2 - T)) / d < 0 with T = tnear dz, s the sign
  /// of dz. With p = max |x| max |y|, float errs in u, v, w by 2^-22 p each, and in the sum by less than
  /// 2^-19 p (max |z - T| + |T|). Decide's t is then below tnear by more than it errs, and clamped stays below it,
  /// since no side of the box that the ray enters by lies ahead of the origin. That takes tnear >= 0; T is NaN where
  /// this does not hold, or where a hit at tnear may count.
  [[gnu::always_inline]] unsigned Behind(const Block& block, const Sheared& s, F u, F v, F w) const {
    const auto flipped = [](F f, int32_t sign) { return F(I(f) ^ sign); };
    const auto first = [&](unsigned axis, float org, int32_t sign) {
      F least = flipped(Load<F>(block.v[0][axis]) - Splat<F>(org), sign);
      for (int c = 1; c < 3; ++c)
        least = Smaller<kLanes>(flipped(Load<F>(block.v[c][axis]) - Splat<F>(org), sign), least);
      return least;
    };
    const F ahead = Larger<kLanes>(first(kx_, org_x_, sign_x_),
                                   Larger<kLanes>(first(ky_, org_y_, sign_y_), first(kz_, org_z_, sign_z_)));
    const auto most = [](F a, F b, F c) { return Larger<kLanes>(Abs(a), Larger<kLanes>(Abs(b), Abs(c))); };
    const F before = Splat<F>(before_);
    const F z0 = s.z[0] - before, z1 = s.z[1] - before, z2 = s.z[2] - before;
    const F p = most(s.x[0], s.x[1], s.x[2]) * most(s.y[0], s.y[1], s.y[2]);
    const F d = (u + v) + w, sum = (u * z0 + v * z1) + w * z2;
    const F signed_sum = F(I(sum) ^ (I(d) & int32_t(0x80000000)) ^ sign_z_);
    const F error = p * ((most(z0, z1, z2) + Abs(before)) * Splat<F>(0x1p-18f)) + Splat<F>(0x1p-100f);
    return Less<kLanes>(signed_sum, -error) & Less<kLanes>(p * 0x1p-18f + Splat<F>(RayShear::kTiny), Abs(d)) &
           LessEqual<kLanes>(ahead, F{});
  }

  static F ToFloat(D d) { return __builtin_convertvector(d, F); }
  static D ToDouble(F f) { return __builtin_convertvector(f, D); }
  static unsigned MaskOf(Vec<int64_t, kLanes> lanes) { return Mask(__builtin_convertvector(lanes, I)); }

  /// As RayState<WatertightTest>::Triangle, for the candidates.
  template <bool kAnyHit>
  [[gnu::always_inline]] bool Decide(const Block& block, unsigned candidates, rb_hit& best) const {
    const Sheared s = Shear(block);
    const F least_z = Smaller<kLanes>(Abs(s.z[0]), Smaller<kLanes>(Abs(s.z[1]), Abs(s.z[2])));
    unsigned unusual = candidates & Less<kLanes>(least_z, Splat<F>(least_z_));
    // u, v, w of exact products, as in IntersectSheared.
    const D x0 = ToDouble(s.x[0]), x1 = ToDouble(s.x[1]), x2 = ToDouble(s.x[2]), y0 = ToDouble(s.y[0]),
            y1 = ToDouble(s.y[1]), y2 = ToDouble(s.y[2]), z0 = ToDouble(s.z[0]), z1 = ToDouble(s.z[1]),
            z2 = ToDouble(s.z[2]);
    const D zero{};  // added, it makes +0 of -0, as there
    const D u = x2 * y1 - y2 * x1 + zero, v = x0 * y2 - y0 * x2 + zero, w = x1 * y0 - y1 * x0 + zero;
    const D det = u + v + w;
    const auto outside =
        (((u < zero) | (v < zero) | (w < zero)) & ((u > zero) | (v > zero) | (w > zero))) | (det == zero);
    const D z = (u * z0 + v * z1 + w * z2) / det;
    const D t = z / Splat<D>(dz_);
    const auto absolute = [](D d) { return D(Vec<int64_t, kLanes>(d) & 0x7FFFFFFFFFFFFFFF); };
    const auto in_plane = absolute(z) < 0x1p-48 * (absolute(z0) + absolute(z1) + absolute(z2));
    candidates &= ~MaskOf(outside);
    unusual |= candidates & MaskOf(in_plane);
    F tnear, tfar;
    Interval(block, tnear, tfar);
    const F clamped = Smaller<kLanes>(tfar, Larger<kLanes>(tnear, ToFloat(t)));
    candidates &= LessEqual<kLanes>(tnear, tfar) & LessEqual<kLanes>(clamped, Splat<F>(best.t)) &
                  LessEqual<kLanes>(Splat<F>(query_.ray.tnear), clamped) & ~unusual;
    bool changed = false;
    while (candidates != 0) {
      const int i = __builtin_ctz(candidates);
      candidates &= candidates - 1;
      const float ti = clamped[i];
      if (!query_.Accepts(ti, block.prim[i], best)) continue;
      best = {ti, 0, 0, block.prim[i]};
      if (kAnyHit) return true;
      if (needs_uv_) best.u = float(v[i] / det[i]), best.v = float(w[i] / det[i]);
      changed = true;
    }
    while (unusual != 0) [[unlikely]] {
        const int i = __builtin_ctz(unusual);
        unusual &= unusual - 1;
        changed |= TakeOne(query_, block, i, best);
        if (kAnyHit && changed) return true;
      }
    return changed;
  }

  /// Of PaddedBounds of the triangles, as SlabRay::Interval has it.
  [[gnu::always_inline]] void Interval(const Block& block, F& tnear, F& tfar) const {
    F lo[3], hi[3];
    for (int a = 0; a < 3; ++a) {
      const F p0 = Load<F>(block.v[0][a]), p1 = Load<F>(block.v[1][a]), p2 = Load<F>(block.v[2][a]);
      lo[a] = Smaller<kLanes>(p0, Smaller<kLanes>(p1, p2)),
      hi[a] = Larger<kLanes>(p0, Larger<kLanes>(p1, p2));
    }
    const F extent = Larger<kLanes>(hi[0] - lo[0], Larger<kLanes>(hi[1] - lo[1], hi[2] - lo[2]));
    const F pad = Larger<kLanes>(extent * 0x1p-20f, Splat<F>(std::numeric_limits<float>::denorm_min()));
    constexpr float kInf = std::numeric_limits<float>::infinity();
    tnear = Splat<F>(-kInf), tfar = Splat<F>(kInf);
    for (int a = 0; a < 3; ++a) {
      lo[a] = lo[a] - Larger<kLanes>(pad, Abs(lo[a]) * 0x1p-23f);
      hi[a] = hi[a] + Larger<kLanes>(pad, Abs(hi[a]) * 0x1p-23f);
      const I upper_first = Splat<I>(-int32_t(slab_.signs >> a & 1));
      const F first = upper_first ? hi[a] : lo[a], second = upper_first ? lo[a] : hi[a];
      tnear = Larger<kLanes>((first - Splat<F>(slab_.org[a])) * Splat<F>(slab_.inv_near[a]), tnear);
      tfar = Smaller<kLanes>((second - Splat<F>(slab_.org[a])) * Splat<F>(slab_.inv_far[a]), tfar);
    }
  }

  [[gnu::noinline]] static bool TakeOne(const RayQuery& query, const Block& block, int i, rb_hit& best) {
    const RayState<WatertightTest> state(query);
    const auto corner = [&](int c) { return Vec3f{block.v[c][0][i], block.v[c][1][i], block.v[c][2][i]}; };
    return state.Triangle(corner(0), corner(1), corner(2), block.prim[i], best);
  }

  const RayQuery& query_;
  const SlabRay4& slab_;
  unsigned kx_, ky_, kz_;
  float org_x_, org_y_, org_z_, sx_, sy_, dz_, least_z_, before_;
  int32_t sign_x_, sign_y_, sign_z_;
  bool needs_uv_;
};

}  // namespace raybench
