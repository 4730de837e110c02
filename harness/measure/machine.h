// What a result depends on besides the code under test: machine, compiler, flags, libraries, commit.
#pragma once

#include <string>
#include <vector>

#include "harness/base/json.h"

namespace raybench {

/// CPU, cores, memory, operating system, as found at run time. A fact that cannot be found is null.
Json MachineFacts();
/// 8 hex digits that machines on which the same times can be expected share: over processor, its flags, number of
/// processors, memory and operating system, but not the host's name.
std::string MachineFingerprint();
/// Version, commit, compiler, flags.
Json BuildFacts();
/// Versions of the libraries, and instruction sets where they choose one at run time.
Json LibraryFacts();
/// 16 hex digits over this executable and the files named, by what their linker noted of their contents or else by the
/// contents: the same program gives the same.
std::string ProgramDigest(const std::vector<std::string>& plugins);
/// For --version: all of that in a few lines, and the licence note.
std::string VersionText();
/// "raybench 0.1.0", for the metadata of pictures and files.
std::string SoftwareName();
/// Whether the exact oracle over CGAL is built in.
bool HasCgalOracle();

/// Bytes that this process may take at most: the machine's memory, or what its cgroup or `ulimit -v` leaves.
uint64_t UsableMemory();

/// The time now in UTC, as strftime() formats it.
std::string UtcTime(const char* format);
/// Bytes of this process resident now, and the most since ResetPeakMemory(); 0 when the system does not tell.
uint64_t ResidentMemory();
uint64_t PeakMemory();
/// False when the system does not allow it; PeakMemory() means nothing then.
bool ResetPeakMemory();

}  // namespace raybench
