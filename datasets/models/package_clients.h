// The package clients of the system (apt, pip, npm, cargo) and the archives that they bring. Children are
// started without a shell, work in the given folder, and their output goes into a file there, whose last
// words make the error message.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace raybench {

/// Called about ten times a second while a child runs. Throws to end the child (with SIGTERM) and be
/// passed on.
using WhileRunning = std::function<void()>;

/// "" if all programs that the client needs are in the path, else one line that names the missing one and
/// says where it comes from.
std::string MissingProgram(const std::string& client);

/// Downloads one version of a package into `folder`, which may hold what an interrupted download left.
/// Retries little, so that without a network it says so soon. Returns "" or what went wrong, in one line.
std::string Download(const std::string& client, const std::string& package, const std::string& version,
                     const std::filesystem::path& folder, const WhileRunning& while_running);

/// Takes a member ("PATH", or "ARCHIVE!PATH", any number of times) out of a package downloaded into `folder`.
/// What is unpacked stays in `folder` and is found again. Throws InputError: no such member, broken archive.
std::filesystem::path Unpack(const std::string& client, const std::string& package,
                             const std::filesystem::path& folder, const std::string& member,
                             const WhileRunning& while_running);

}  // namespace raybench
