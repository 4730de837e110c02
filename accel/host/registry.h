// The structures a process knows: the built-in ones and those of loaded plugins.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "accel/base/error.h"
#include "accel/contract/raybench.h"
#include "accel/contract/valid_ray.h"
#include "accel/host/parameters.h"

namespace raybench {

/// Works on a device of its own: the processor's clocks do not see it.
inline bool IsOnDevice(const rb_structure& structure) { return (structure.capabilities & RB_DEVICE) != 0; }

/// One line that says why the structure cannot be built on this machine; empty: it can, as far as it says.
std::string WhyUnavailable(const rb_structure& structure);

class Registry {
 public:
  /// Starts with every built-in structure, sorted by name.
  Registry();

  /// Structures that are asked for by name alone, and so are in no list of all: NAME.so in this folder is a plugin
  /// with the structure NAME, which Find() loads.
  void SetOnRequest(const std::string& folder) { on_request_ = folder; }
  /// Their names, sorted.
  std::vector<std::string> OnRequest() const;
  /// Structures of raybench that are not here, sorted by name: each with one line why.
  std::map<std::string, std::string> Absent() const;

  /// Loads a shared library and adds what it exports. Plugins stay loaded until the process ends.
  /// Throws InputError naming the file when it cannot be loaded, speaks another ABI, lacks a required
  /// function, or brings a name that is taken.
  void LoadPlugin(const std::string& path);

  /// Throws InputError listing the known names.
  const rb_structure& Find(std::string_view name) const;
  std::span<const rb_structure* const> structures() const { return structures_; }
  /// Path of the plugin that brought the structure; empty for built-in ones.
  std::string OriginOf(const rb_structure& structure) const;

 private:
  void Add(const rb_structure* structure, const std::string& origin);
  std::string FileOnRequest(std::string_view name) const;

  std::string on_request_;  ///< folder; empty: none
  std::vector<const rb_structure*> structures_;
  std::vector<std::string> origins_;
};

/// A structure together with a checked configuration.
struct Contestant {
  const rb_structure* structure = nullptr;
  std::vector<std::byte> config;

  std::string Spec() const;    ///< short: only what differs from the defaults
  std::string Params() const;  ///< canonical: every parameter
};

/// Parses and checks one "name(key=value,...)".
Contestant ParseContestant(const Registry& registry, std::string_view text);

/// A query that a device did not answer, as after it was lost: one line with structure and reason. Nothing of the
/// query's results is to be used, nor is the tree.
struct QueryError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Owns a built tree.
class Tree {
 public:
  Tree() = default;
  /// Builds; throws BuildError with the structure's own message.
  Tree(const Contestant& contestant, const rb_geometry& geometry, const rb_build_options& options);

  explicit operator bool() const { return tree_ != nullptr; }
  const rb_structure& structure() const { return *structure_; }
  const rb_tree* get() const { return tree_.get(); }

  /// Throws QueryError; only a device does so.
  void Query(const rb_query& query) const {
    if (IsOnDevice(*structure_)) [[unlikely]]
      return QueryDevice(query);
    structure_->query(tree_.get(), &query);
  }
  void QueryCounted(const rb_query& query) const { structure_->query_counted(tree_.get(), &query); }
  uint32_t Claims() const { return structure_->claims(tree_.get()); }
  /// What its device did so far; nothing if it works on the processor.
  std::optional<rb_device> Device() const;

 private:
  void QueryDevice(const rb_query& query) const;

  const rb_structure* structure_ = nullptr;
  std::unique_ptr<rb_tree, void (*)(rb_tree*)> tree_{nullptr, nullptr};
};

/// Default options: all fields set, one thread, everything needed but `after` and `skip`.
rb_build_options DefaultBuildOptions();

}  // namespace raybench
