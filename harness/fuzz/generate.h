// Cases at random: geometry and rays where arithmetic is at its worst, or where integers leave no doubt.
#pragma once

#include "accel/base/random.h"
#include "accel/host/registry.h"
#include "harness/fuzz/case.h"

namespace raybench::fuzz {

enum class Mode { kExact, kChaotic, kBoth };

/// Case `index` of the campaign with this seed, without a structure: the same on every machine. Exact mode:
/// triangles on a lattice of small integers. Chaotic mode: a few parts, each of one of many kinds (shells,
/// fans, slivers, copies, flat boxes, magnitudes down to subnormal numbers, procedural primitives, ...) at a
/// random scale, sometimes far from the origin. Rays are aimed at vertices, edges, along axes with zeros of
/// both signs, within planes, from far, with short and long directions and intervals that begin or end at
/// something.
Case GenerateCase(Mode mode, uint64_t seed, uint64_t index);

/// Small scenes of raybench's generators, each with rays of each family that is aimed at them
/// (harness/rays/aim.h): what `verify` would ask. `index` is below StandardCaseCount(); without rays where the
/// scene has none of the family. Starts threads: only a child may make them.
size_t StandardCaseCount();
Case StandardCase(size_t index, uint64_t seed);

/// Replaces the rays by `count` others aimed at the geometry, as those of GenerateCase() are.
void AimAnew(Case& c, size_t count, Random& random);

/// `structure` with parameters at random, half of them at their default, as a specification.
std::string DrawParameters(const rb_structure& structure, Random& random);

}  // namespace raybench::fuzz
