#include "datasets/models/manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "accel/host/names.h"
#include "datasets/readers/readers.h"

namespace raybench {

extern const char kManifestJson[];  // manifest_json.cpp, made from manifest.json

namespace {

Vec3f Vector(const nlohmann::json& j) {
  return {j.at(0).get<float>(), j.at(1).get<float>(), j.at(2).get<float>()};
}

ManifestEntry ParseEntry(const nlohmann::json& j, const nlohmann::json& packages) {
  ManifestEntry e;
  j.at("name").get_to(e.name);
  j.at("doc").get_to(e.doc);
  j.at("family").get_to(e.family);
  j.at("package").get_to(e.package);
  const nlohmann::json& package = packages.at(e.package);
  package.at("client").get_to(e.client);
  package.at("versions").get_to(e.versions);
  package.at("bytes").get_to(e.package_bytes);
  j.at("member").get_to(e.file.member);
  j.at("sha256").get_to(e.file.sha256);
  j.at("licence").get_to(e.licence);
  j.at("format").get_to(e.format);
  j.at("triangles").get_to(e.triangles);
  e.author = j.value("author", "");
  // Files beside are named relative to the model's own folder.
  const std::string folder = e.file.member.substr(0, e.file.member.find_last_of("!/") + 1);
  const nlohmann::json beside = j.value("beside", nlohmann::json::object());
  for (const auto& [path, sha256] : beside.items()) e.beside.push_back({folder + path, sha256});
  if (j.contains("conversion")) {
    const nlohmann::json& c = j["conversion"];
    c.at("kind").get_to(e.conversion.kind);
    c.at("sha256").get_to(e.conversion.sha256);
    if (c.contains("spacing")) c["spacing"].get_to(e.conversion.spacing);
    e.conversion.exaggeration = c.value("exaggeration", 1.0);
  }
  const nlohmann::json cameras = j.value("cameras", nlohmann::json::array());
  for (const nlohmann::json& c : cameras) {
    e.cameras.push_back({Vector(c.at("eye")), Vector(c.at("at")),
                         c.contains("up") ? Vector(c["up"]) : Vec3f{0, 1, 0},
                         c.at("tan_half_fov").get<float>()});
  }
  const nlohmann::json lights = j.value("lights", nlohmann::json::array());
  for (const nlohmann::json& l : lights)
    e.lights.push_back({Vector(l.at("position")), Vector(l.at("intensity")), false});
  return e;
}

std::vector<ManifestEntry> ParseManifest() {
  const nlohmann::json manifest = nlohmann::json::parse(kManifestJson);
  std::vector<ManifestEntry> entries;
  for (const nlohmann::json& model : manifest.at("models"))
    entries.push_back(ParseEntry(model, manifest.at("packages")));
  return entries;
}

std::vector<std::string_view> Names() {
  std::vector<std::string_view> names;
  for (const ManifestEntry& entry : Manifest()) names.push_back(entry.name);
  return names;
}

}  // namespace

const std::vector<ManifestEntry>& Manifest() {
  static const std::vector<ManifestEntry> entries = ParseManifest();
  return entries;
}

const ManifestEntry& FindManifestEntry(const std::string& name) {
  for (const ManifestEntry& entry : Manifest())
    if (entry.name == name) return entry;
  throw InputError(fmt::format("unknown model '{}'{}; see: raybench list models", OneLine(name),
                               DidYouMean(name, Names())));
}

std::vector<const ManifestEntry*> FindModels(const std::string& name_or_family) {
  std::vector<const ManifestEntry*> found;
  for (const ManifestEntry& entry : Manifest())
    if (entry.name == name_or_family || entry.family == name_or_family) found.push_back(&entry);
  if (found.empty()) {
    std::vector<std::string_view> known = Names();
    known.insert(known.end(), std::begin(kModelFamilies), std::end(kModelFamilies));
    throw InputError(fmt::format(
        "unknown model '{}'{}; allowed are the families {} and what `raybench list models` has",
        OneLine(name_or_family), DidYouMean(name_or_family, known), fmt::join(kModelFamilies, ", ")));
  }
  return found;
}

}  // namespace raybench
