#include "harness/fuzz/shrink.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "accel/host/parameters.h"
#include "harness/fuzz/generate.h"

namespace raybench::fuzz {
namespace {

class Shrinker {
 public:
  Shrinker(const Case& failing, const std::function<bool(const Case&)>& fails,
           const std::function<bool()>& stop)
      : fails_(fails), stop_(stop), best_(failing) {}

  Shrunk Run() {
    do {
      Reduce();
    } while (AimedElsewhere() && !stop_());
    for (int rounds = 0; rounds < 3 && !stop_() && ShorterNumbers(); ++rounds) {
    }
    return {best_, tries_};
  }

 private:
  void Reduce() {
    for (bool better = true; better && !stop_();) {
      better = false;
      better |= Fewer([](Case & c) -> auto& { return c.rays; });
      better |= Fewer([](Case & c) -> auto& { return c.triangles; });
      better |= Fewer([](Case & c) -> auto& { return c.spheres; });
      better |= Fewer([](Case & c) -> auto& { return c.cones; });
      better |= Fewer([](Case & c) -> auto& { return c.polygons; });
      DropUnusedVertices();
      better |= PlainParameters();
      better |= PlainIntervals();
    }
  }

  /// Fewer primitives may fail only with other rays: a few of those there are, drawn at random, the fewest first.
  bool AimedElsewhere() {
    constexpr size_t kSmall = 4, kLarge = 200, kTries = 24, kRays = 400;
    const size_t n = best_.primitives();
    if (best_.rays.size() != 1 || n < 2 || n > kLarge) return false;
    Random random(best_.seed, tries_);
    for (size_t size = 1; size < std::min(n, n > kSmall ? kSmall + 1 : n); ++size) {
      for (size_t i = 0; i < kTries && !stop_(); ++i) {
        Case candidate = best_;
        while (candidate.primitives() > size) DropOne(candidate, random.Below(candidate.primitives()));
        AimAnew(candidate, kRays, random);
        // Large leaves need much to fill them.
        if (i % 2 == 0) candidate.structure = ParseSpec(best_.structure).name;
        if (Try(candidate)) return true;
      }
    }
    // What only a crowd of primitives shows here may be shown by few others.
    for (uint64_t i = 0; n > kSmall && i < 8 * kTries && !stop_(); ++i) {
      Case candidate = GenerateCase(best_.exact ? Mode::kExact : Mode::kChaotic, best_.seed, i);
      while (candidate.primitives() > kSmall) DropOne(candidate, random.Below(candidate.primitives()));
      AimAnew(candidate, kRays, random);
      candidate.structure = ParseSpec(best_.structure).name;
      candidate.check = best_.check, candidate.seed = best_.seed;
      if (Try(candidate)) return true;
    }
    return false;
  }
  static void DropOne(Case& c, size_t prim) {
    const auto drop = [&](auto& list) {
      if (prim < list.size()) {
        list.erase(list.begin() + ptrdiff_t(prim));
        return true;
      }
      prim -= list.size();
      return false;
    };
    if (!drop(c.triangles) && !drop(c.spheres) && !drop(c.cones)) drop(c.polygons);
  }

  bool Try(const Case& candidate) {
    if (stop_()) return false;
    ++tries_;
    if (!fails_(candidate)) return false;
    best_ = candidate;
    return true;
  }

  /// Leaves out runs of items, shorter and shorter ones.
  template <class Items>
  bool Fewer(const Items& items) {
    bool better = false;
    // Most cases need one ray: ask for each before halving.
    for (size_t run = std::max<size_t>(1, items(best_).size() - 1); run >= 1; run /= 2) {
      for (size_t first = 0; first < items(best_).size();) {
        Case candidate = best_;
        auto& list = items(candidate);
        const size_t end = std::min(first + run, list.size());
        list.erase(list.begin() + ptrdiff_t(first), list.begin() + ptrdiff_t(end));
        if (Try(candidate)) {
          better = true;
        } else {
          first += run;
        }
        if (stop_()) return better;
      }
    }
    return better;
  }

  /// Vertices that nothing names, and equal ones, go.
  void DropUnusedVertices() {
    Case candidate = best_;
    std::vector<Vec3f> kept;
    const auto keep = [&](uint32_t& corner) {
      const Vec3f p = best_.positions[corner];
      size_t i = 0;
      while (i < kept.size() && !(SameBits(kept[i], p))) ++i;
      if (i == kept.size()) kept.push_back(p);
      corner = uint32_t(i);
    };
    for (auto& t : candidate.triangles) std::for_each(t.begin(), t.end(), keep);
    for (auto& p : candidate.polygons) std::for_each(p.begin(), p.end(), keep);
    candidate.positions = kept;
    if (candidate.positions.size() < best_.positions.size()) Try(candidate);
  }
  static bool SameBits(Vec3f a, Vec3f b) {
    return a == b && std::signbit(a.x) == std::signbit(b.x) && std::signbit(a.y) == std::signbit(b.y) &&
           std::signbit(a.z) == std::signbit(b.z);
  }

  bool PlainParameters() {
    bool better = false;
    const Spec spec = ParseSpec(best_.structure);
    std::vector<std::pair<std::string, std::string>> values = spec.values;
    for (size_t i = 0; i < values.size();) {
      auto fewer = values;
      fewer.erase(fewer.begin() + ptrdiff_t(i));
      Case candidate = best_;
      candidate.structure = spec.name;
      for (size_t k = 0; k < fewer.size(); ++k)
        candidate.structure += fmt::format("{}{}={}", k == 0 ? "(" : ",", fewer[k].first, fewer[k].second);
      if (!fewer.empty()) candidate.structure += ")";
      if (Try(candidate)) {
        values = fewer, better = true;
      } else {
        ++i;
      }
    }
    return better;
  }

  bool PlainIntervals() {
    bool better = false;
    for (size_t i = 0; i < best_.rays.size(); ++i) {
      for (const bool near : {true, false}) {
        Case candidate = best_;
        float& end = near ? candidate.rays[i].tnear : candidate.rays[i].tfar;
        const float plain = near ? 0 : std::numeric_limits<float>::infinity();
        if (end == plain) continue;
        end = plain;
        better |= Try(candidate);
      }
    }
    return better;
  }

  /// Digits and magnitude: what a reader has to take in.
  static size_t Length(float x) { return fmt::format("{}", x).size(); }

  bool ShorterNumbers() {
    bool better = false;
    for (size_t i = 0; i < NumbersOf(best_).size(); ++i) {
      const float x = *NumbersOf(best_)[i];
      if (x == 0 && !std::signbit(x)) continue;
      std::vector<float> shorter = {0, std::round(x)};
      for (int digits : {1, 2, 4})
        shorter.push_back(std::strtof(fmt::format("{:.{}g}", x, digits).c_str(), nullptr));
      for (float candidate_value : shorter) {
        if (!std::isfinite(candidate_value) || Length(candidate_value) >= Length(x)) continue;
        Case candidate = best_;
        *NumbersOf(candidate)[i] = candidate_value;
        if (Try(candidate)) {
          better = true;
          break;
        }
        if (stop_()) return better;
      }
    }
    return better;
  }

  static std::vector<float*> NumbersOf(Case& c) {
    std::vector<float*> numbers;
    const auto point = [&](Vec3f& p) { numbers.insert(numbers.end(), {&p.x, &p.y, &p.z}); };
    for (Vec3f& p : c.positions) point(p);
    for (Sphere& s : c.spheres) point(s.center), numbers.push_back(&s.radius);
    for (Cone& k : c.cones)
      point(k.base), point(k.apex), numbers.push_back(&k.base_radius), numbers.push_back(&k.apex_radius);
    for (rb_ray& r : c.rays) {
      for (int k = 0; k < 3; ++k) numbers.push_back(&r.org[k]), numbers.push_back(&r.dir[k]);
      numbers.push_back(&r.tnear);
      if (std::isfinite(r.tfar)) numbers.push_back(&r.tfar);
    }
    return numbers;
  }

  const std::function<bool(const Case&)>& fails_;
  const std::function<bool()>& stop_;
  Case best_;
  uint64_t tries_ = 0;
};

}  // namespace

Shrunk Shrink(const Case& failing, const std::function<bool(const Case&)>& fails,
              const std::function<bool()>& stop) {
  return Shrinker(failing, fails, stop).Run();
}

}  // namespace raybench::fuzz
