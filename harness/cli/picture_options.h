// The options of `raybench render` that say how a picture is sampled and shaded.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"
#include "tracer/tracer.h"

namespace raybench {

/// As typed; an option that was not given has no value.
struct PictureOptions {
  std::optional<uint32_t> samples;
  std::optional<std::string> pattern, filter, self_intersection, fresnel, shadows, background, environment;
  std::optional<float> adaptive, self_intersection_size, min_contribution;
  std::string rules = "whitted", needs = "scene";
  uint64_t sampling_seed = 1;
};

/// Adds the options to the command; returns them.
std::vector<CLI::Option*> AddPictureOptions(CLI::App& command, PictureOptions& options);

/// Sets the fields of `trace` that the options are about. Throws InputError naming the option and what is
/// allowed, for combinations that mean nothing too.
void SetTraceOptions(const PictureOptions& options, TraceOptions& trace);

/// Gives the scene the background or environment that the options name, if any. Throws InputError naming the
/// option or the file.
void SetBackground(const PictureOptions& options, Scene& scene);

/// What the tree that answers must do: the scene's needs under these options (RB_NEED_*). Throws InputError
/// when `structure` cannot.
uint64_t BuildNeedsOf(const Scene& scene, const TraceOptions& trace, const rb_structure& structure);

}  // namespace raybench
