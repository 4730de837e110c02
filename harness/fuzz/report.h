// What `raybench fuzz` tells and leaves behind.
#pragma once

#include <string>

#include "harness/fuzz/fuzz.h"

namespace raybench::fuzz {

/// "2 primitives, 1 ray".
std::string SizeOf(const Case& c);

/// Writes a case file for each fault, whose `file` it sets, and fuzz.json into options.out. Throws InputError
/// if that is not possible.
void WriteFindings(const FuzzOptions& options, FuzzResult& result);

/// Runs Fuzz(), prints the table and the findings, and writes them if there are any. Returns 0 nothing found,
/// 1 findings, 130 interrupted without any.
int RunFuzz(const Registry& registry, const FuzzOptions& options);

}  // namespace raybench::fuzz
