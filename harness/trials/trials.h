// Trees of one scene that are built, timed beside each other and dropped as somebody else decides: what
// `raybench tune` and `raybench advise` measure by. Everything runs on one thread and is timed by the
// processor time that it takes.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "accel/base/random.h"
#include "harness/base/json.h"
#include "harness/trials/mix.h"
#include "harness/truth/oracle.h"

namespace raybench {

class Trials {
 public:
  /// Captures the rays. `scene` must outlive this, unmoved.
  Trials(const Registry& registry, const Scene& scene, const MixOptions& options);

  /// The scene, the mix and its rays, the memory that trees may take.
  Json Facts() const;
  /// Answers one request, an object with one of the keys below; the answer has the key "error" with one line
  /// where it cannot be met. What takes long ends with InterruptedError after a Ctrl-C.
  ///
  ///   {"build": SPEC, "seconds": LIMIT}   builds a tree. LIMIT, of processor time, and the memory limit end it
  ///       -> "tree" (its number), "seconds", "bytes" (with the geometry where it is needed), "claims";
  ///          or "stopped" with the reason and "seconds"
  ///   {"time": [TREES], "rays": N, "rounds": K, "held_out": BOOL, "seconds": LIMIT}
  ///          asks each for N rays of the mix in K rounds, by turns in random order, fewer after LIMIT
  ///       -> "ns" [tree][round][set]: nanoseconds a ray
  ///   {"judge": TREE, "rays": N}   compares answers to N rays of the mix, and to N that are aimed at edges
  ///          and vertices, with exact truth
  ///       -> "mix" and "aimed": "rays", "errors" (leaks and plain errors), "t_error_max" (ulp); "broken" (the
  ///          claim that it breaks, in words)
  ///   {"drop": [TREES]}   -> {}
  Json Answer(const Json& request);

 private:
  struct Asked {
    std::vector<std::vector<rb_ray>> rays;  ///< a set each
    size_t most = 0;
  };
  struct Judging {
    uint32_t query;
    std::vector<rb_ray> rays;
    std::vector<Truth> truth;
    bool aimed;
  };

  Json Build(const std::string& spec, double limit);
  Json Time(const std::vector<uint64_t>& trees, const Json& request);
  Json Judge(uint64_t tree, uint64_t rays);
  Asked Part(bool held_out, uint64_t rays) const;
  const Tree& Find(uint64_t tree) const;
  void FindTruth(uint64_t rays);

  const Registry& registry_;
  const Scene& scene_;
  const uint64_t seed_, needs_, memory_limit_;
  const std::vector<MixedSet> mix_;
  Random random_;
  std::map<uint64_t, Tree> trees_;
  uint64_t next_ = 1;
  std::unique_ptr<Oracle> oracle_;
  std::vector<Judging> judging_;  ///< of `judged_rays_` rays
  uint64_t judged_rays_ = 0;
};

/// Reads requests from stdin, a line each, and writes the facts and then each answer to stdout, until stdin
/// ends. Returns the exit code.
int ServeTrials(Trials& trials);

}  // namespace raybench
