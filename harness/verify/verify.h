// `raybench verify`: does a structure lose rays? Aimed rays against exact truth, and the tree itself against
// what it must enclose.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench {

struct VerifyOptions {
  std::vector<std::string> scenes;
  bool all = false;  ///< a line for each scene, and its table only where something is broken
  std::vector<std::string> structures;  ///< as EveryArithmetic() takes them
  std::vector<std::string> sets;        ///< of AimedFamilies(); empty: all
  std::vector<std::string> ray_files;   ///< .rays files or folders of them, judged instead of the sets
  std::vector<std::string> plugins;     ///< already loaded; repeated in the commands that replay a ray
  uint64_t rays = 0;                    ///< of a set; 0: the default, or whole files
  uint64_t seed = 1;
  uint32_t threads = 0;    ///< 0: all
  uint32_t examples = 5;   ///< worst answers shown of a structure
  bool any = false;        ///< any-hit queries of all rays, not of a quarter
  bool drop_bad = false;   ///< as in LoadOptions
  std::string out;         ///< folder for the files; empty: none are written
  uint64_t closed = 0;     ///< rays of RunClosed()
  uint64_t crossings = 0;  ///< points of RunCrossings()
  std::string ledger;      ///< file in which RunClosed() adds up; empty: none
  std::vector<std::string> command_line;

  uint64_t RaysPerSet() const { return rays != 0 ? rays : 1u << 14; }
};

/// Judges, prints the tables to stdout and everything else to stderr, writes files if asked to. Returns the
/// exit code: 0; 1 if a claim, the contract or a tree is broken; 3 if a structure could not be built; 130 if
/// interrupted (verdicts so far are printed and written). Throws InputError before work starts if possible.
int RunVerify(const Registry& registry, const VerifyOptions& options);

/// Judges one ray, given as ParseRay() reads it, in the only scene named, and prints all that is known of it.
/// Exit code as above.
int ReplayOneRay(const Registry& registry, const VerifyOptions& options, const std::string& ray);

/// "ox,oy,oz,tnear,dx,dy,dz,tfar" in the coordinates of the file of a scene that is traced at
/// 2^scale_exponent times its size: text that ParseRay() reads back to the same bits.
std::string FormatRay(const rb_ray& ray, int scale_exponent);

struct TypedRay {
  rb_ray ray;           ///< as the scene is traced
  std::string rounded;  ///< which numbers were no floats, and what they were taken for; empty: none
};
/// Numbers as files have them, decimal or hexadecimal. One that is no float is taken for the nearest. Throws
/// InputError naming the item: not eight, beyond float, or no valid ray.
TypedRay ParseRay(const std::string& text, int scale_exponent);

}  // namespace raybench
