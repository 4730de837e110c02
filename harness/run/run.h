// `raybench run`: plan -> load -> capture -> truth -> build -> verdict -> counts -> times -> files -> table.
#pragma once

#include "accel/host/registry.h"
#include "harness/plan/plan.h"

namespace raybench {

/// Does a whole run and returns the exit code: 0; 1 if a claim was broken; 3 if the default model could not
/// be fetched; 130 if interrupted (finished cases are on disk, CSVs included). Prints the table to stdout,
/// everything else to stderr. Throws InputError before anything is written to disk if possible.
int RunBenchmark(const Registry& registry, const RunOptions& options);

}  // namespace raybench
