#include "accel/host/registry.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>

#include "accel/host/builtin.h"
#include "accel/host/compatible.h"
#include "accel/host/names.h"

namespace raybench {
namespace {

bool IsStructureName(std::string_view name) {
  if (name.empty() || name.front() < 'a' || name.front() > 'z') return false;
  return std::all_of(name.begin(), name.end(),
                     [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; });
}

/// Empty if the table keeps the contract as far as can be seen without calling it.
std::string Flaw(const rb_structure& s) {
  if (s.abi_version != RAYBENCH_ABI_VERSION) {
    return fmt::format("a structure has ABI version {}, this raybench speaks {}", s.abi_version,
                       RAYBENCH_ABI_VERSION);
  }
  if (s.struct_size < offsetof(rb_structure, visit) + sizeof s.visit) {
    return fmt::format("a structure's struct_size is {}, at least {} is needed", s.struct_size,
                       offsetof(rb_structure, visit) + sizeof s.visit);
  }
  if (s.name == nullptr || !IsStructureName(s.name))
    return "a structure's name is not of the form [a-z][a-z0-9_]*";
  if (s.doc == nullptr || s.source == nullptr)
    return fmt::format("structure '{}' lacks doc or source", s.name);
  if (std::string_view(s.doc).find('\n') != std::string_view::npos)
    return fmt::format("structure '{}': doc is more than one line", s.name);
  for (auto [present, what] :
       {std::pair(s.build != nullptr, "build"), std::pair(s.destroy != nullptr, "destroy"),
        std::pair(s.query != nullptr, "query"), std::pair(s.claims != nullptr, "claims"),
        std::pair(s.memory != nullptr, "memory")}) {
    if (!present) return fmt::format("structure '{}' lacks the required function {}", s.name, what);
  }
  if ((s.capabilities & RB_CAN_COUNT) != 0 && s.query_counted == nullptr) {
    return fmt::format("structure '{}' says RB_CAN_COUNT but lacks query_counted", s.name);
  }
  if (s.param_count > 0 && s.params == nullptr)
    return fmt::format("structure '{}' lacks its parameters", s.name);
  if (std::string flaw = FlawOfParameters({s.params, s.param_count}, s.config_size); !flaw.empty())
    return fmt::format("structure '{}': {}", s.name, flaw);
  return {};
}

/// Whether the table is long enough to have the member that ends there: it may come from an older plugin.
bool Reaches(const rb_structure& s, size_t end) { return s.struct_size >= end; }

std::span<const rb_structure* const> LoadTables(const std::string& path) {
  // Without a slash dlopen would search the system's library folders instead of opening the file.
  const std::string file = path.find('/') == std::string::npos ? "./" + path : path;
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    std::string why = dlerror();
    std::replace(why.begin(), why.end(), '\n', ' ');
    throw InputError(fmt::format("plugin {}: {}", path, why));
  }
  auto entry = reinterpret_cast<rb_plugin_entry>(dlsym(library, RAYBENCH_PLUGIN_ENTRY));
  if (entry == nullptr) {
    dlclose(library);
    throw InputError(fmt::format("plugin {}: it does not export {}", path, RAYBENCH_PLUGIN_ENTRY));
  }
  size_t count = 0;
  const rb_structure* const* tables = entry(RAYBENCH_ABI_VERSION, &count);
  if (tables == nullptr || count == 0) {
    throw InputError(
        fmt::format("plugin {}: it offers nothing for ABI version {}", path, RAYBENCH_ABI_VERSION));
  }
  for (size_t i = 0; i < count; ++i)
    if (tables[i] == nullptr) throw InputError(fmt::format("plugin {}: structure {} is NULL", path, i));
  return {tables, count};
}

}  // namespace

std::string WhyUnavailable(const rb_structure& s) {
  if (!Reaches(s, offsetof(rb_structure, unavailable) + sizeof s.unavailable) || s.unavailable == nullptr)
    return {};
  const char* const why = s.unavailable();
  return why != nullptr ? why : "";
}

Registry::Registry() {
  for (const Builtin& builtin : BuiltinStructures()) Add(builtin.table, {});
}

void Registry::Add(const rb_structure* structure, const std::string& origin) {
  const std::string where = origin.empty() ? "built-in structure" : origin;
  if (std::string flaw = Flaw(*structure); !flaw.empty())
    throw InputError(fmt::format("{}: {}", where, flaw));
  for (const rb_structure* known : structures_) {
    if (std::string_view(known->name) == structure->name) {
      throw InputError(fmt::format("{}: the name '{}' is taken already", where, structure->name));
    }
  }
  structures_.push_back(structure);
  origins_.push_back(origin);
}

void Registry::LoadPlugin(const std::string& path) {
  Registry trial = *this;  // all of a plugin's structures are added or none
  for (const rb_structure* table : LoadTables(path)) trial.Add(table, path);
  *this = std::move(trial);
}

std::vector<std::string> Registry::OnRequest() const {
  std::vector<std::string> names;
  std::error_code none;
  if (on_request_.empty()) return names;
  for (const auto& entry : std::filesystem::directory_iterator(on_request_, none))
    if (entry.path().extension() == ".so") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::map<std::string, std::string> Registry::Absent() const {
  const auto is_here = [&](std::string_view name) {
    return (!on_request_.empty() && std::filesystem::exists(FileOnRequest(name))) ||
           std::any_of(structures_.begin(), structures_.end(),
                       [&](const rb_structure* s) { return name == s->name; });
  };
  std::map<std::string, std::string> absent;
  for (const OptionalStructure& s : OptionalStructures()) {
    if (is_here(s.name)) continue;
    absent[s.name] = fmt::format("{}; it takes {}",
                                 s.is_built ? fmt::format("its library {} is missing", FileOnRequest(s.name))
                                            : "this build is without it",
                                 s.takes);
  }
  return absent;
}

std::string Registry::FileOnRequest(std::string_view name) const {
  return (std::filesystem::path(on_request_) / fmt::format("{}.so", name)).string();
}

const rb_structure& Registry::Find(std::string_view name) const {
  std::vector<std::string_view> names;
  for (const rb_structure* structure : structures_) {
    if (name == structure->name) return *structure;
    names.push_back(structure->name);
  }
  const std::vector<std::string> on_request = OnRequest();
  for (const std::string& known : on_request) {
    names.push_back(known);
    if (name != known) continue;
    const std::string file = FileOnRequest(name);
    for (const rb_structure* table : LoadTables(file)) {
      if (std::string flaw = Flaw(*table); !flaw.empty()) throw InputError(fmt::format("{}: {}", file, flaw));
      if (name == table->name) return *table;
    }
  }
  for (const auto& [known, why] : Absent())
    if (name == known) throw InputError(fmt::format("structure '{}' is not here: {}", name, why));
  throw InputError(
      fmt::format("unknown structure '{}'{}; see: raybench list structures", name, DidYouMean(name, names)));
}

std::string Registry::OriginOf(const rb_structure& structure) const {
  for (size_t i = 0; i < structures_.size(); ++i) {
    if (structures_[i] == &structure) return origins_[i];
  }
  return on_request_.empty() ? std::string() : FileOnRequest(structure.name);
}

std::string Contestant::Spec() const {
  return FormatSpec(structure->name, {structure->params, structure->param_count}, config.data());
}

std::string Contestant::Params() const {
  return FormatAllParameters({structure->params, structure->param_count}, config.data());
}

Contestant ParseContestant(const Registry& registry, std::string_view text) {
  Spec spec = ParseSpec(text);
  const rb_structure& structure = registry.Find(spec.name);
  Contestant contestant = {&structure, Configure(structure.name, {structure.params, structure.param_count},
                                                 structure.config_size, spec.values)};
  if (const std::string why = WhyIncompatible(structure, contestant.config.data()); !why.empty())
    throw InputError(fmt::format("{}: {}", contestant.Spec(), why));
  return contestant;
}

Tree::Tree(const Contestant& contestant, const rb_geometry& geometry, const rb_build_options& options)
    : structure_(contestant.structure) {
  rb_tree* tree = nullptr;
  char error[512] = "";
  int failed = structure_->build(&geometry, &options, contestant.config.data(), &tree, error, sizeof error);
  if (failed != 0 || tree == nullptr) {
    throw BuildError(fmt::format("{}: {}", contestant.Spec(), error[0] != 0 ? error : "the build failed"));
  }
  tree_ = {tree, structure_->destroy};
}

void Tree::QueryDevice(const rb_query& query) const {
  try {
    structure_->query(tree_.get(), &query);
  } catch (const std::runtime_error& error) {
    throw QueryError(fmt::format("{}: {}", structure_->name, error.what()));
  }
}

std::optional<rb_device> Tree::Device() const {
  const rb_structure& s = *structure_;
  if (!Reaches(s, offsetof(rb_structure, device) + sizeof s.device) || s.device == nullptr) return {};
  rb_device device{};
  device.struct_size = sizeof device;
  s.device(tree_.get(), &device);
  return device;
}

rb_build_options DefaultBuildOptions() {
  return {sizeof(rb_build_options), 1, 1, RB_NEED_UV | RB_NEED_ANY, 0, nullptr};
}

}  // namespace raybench
