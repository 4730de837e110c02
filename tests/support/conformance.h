// What the conformance tests share: every registered structure, and scenes as structures get them.
#pragma once

#include <cctype>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "tests/support/meshes.h"

namespace raybench::testing {

inline Scene SceneOf(const Mesh& mesh, bool drop_bad = false) {
  Scene scene;
  scene.name = mesh.name;
  scene.provenance.source = "test mesh " + mesh.name;
  scene.positions = mesh.positions;
  scene.triangles = mesh.triangles;
  scene.triangle_material.assign(mesh.triangles.size(), 0);
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i) scene.triangle_face.push_back(i);
  scene.Finish(drop_bad);
  return scene;
}

/// Every structure at its defaults, and at every value of each of its choices and switches. With a plugin
/// (TestRegistry()) those of the plugin alone, if this machine can build them.
inline std::vector<std::string> Specs() {
  std::vector<std::string> specs;
  const Registry& registry = TestRegistry();
  for (const rb_structure* s : registry.structures()) {
    if (std::getenv("RAYBENCH_TEST_PLUGIN") != nullptr && registry.OriginOf(*s).empty()) continue;
    if (const std::string why = WhyUnavailable(*s); !why.empty()) {
      std::printf("%s is not here: %s\n", s->name, why.c_str());
      continue;
    }
    specs.push_back(s->name);
    for (uint32_t i = 0; i < s->param_count; ++i) {
      const rb_param& p = s->params[i];
      if (p.type == RB_BOOL)
        specs.push_back(std::string(s->name) + "(" + p.name + (p.def != 0 ? "=false)" : "=true)"));
      if (p.type != RB_CHOICE) continue;
      for (uint32_t c = 0; p.choices[c] != nullptr; ++c) {
        if (c != uint32_t(p.def))
          specs.push_back(std::string(s->name) + "(" + p.name + "=" + p.choices[c] + ")");
      }
    }
  }
  return specs;
}

/// Leaves of bvh_wide that hold moved triangles, and these alone.
inline bool HasQuantisedLeaves(std::string_view spec) {
  return spec.find("leaves=quantized") != spec.npos || spec.find("leaves=snapped") != spec.npos;
}

/// As GoogleTest wants names: letters, digits and underscores.
inline std::string TestName(std::string text) {
  for (char& c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return text;
}

}  // namespace raybench::testing
