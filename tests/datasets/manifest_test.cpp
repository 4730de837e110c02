// The manifest of real models: complete, and every name means one thing.

#include "datasets/models/manifest.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <set>

#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

bool IsHexDigest(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == text.npos &&
         text.find_first_not_of('0') != text.npos;
}

TEST(ManifestTest, EntriesAreComplete) {
  std::set<std::string> names;
  for (const std::string_view family : kModelFamilies) names.insert(std::string(family));
  for (const Generator* generator : Generators()) names.insert(generator->name);
  for (const ManifestEntry& e : Manifest()) {
    SCOPED_TRACE(e.name);
    EXPECT_TRUE(names.insert(e.name).second) << "also a generator, a family or another model";
    EXPECT_EQ(std::count(kModelFamilies.begin(), kModelFamilies.end(), e.family), 1) << e.family;
    EXPECT_EQ(std::count(kPackageClients.begin(), kPackageClients.end(), e.client), 1) << e.client;
    EXPECT_FALSE(e.package.empty() || e.versions.empty() || e.doc.empty() || e.licence.empty());
    EXPECT_FALSE(e.file.member.empty() || e.file.member.find("..") != e.file.member.npos);
    EXPECT_GT(e.package_bytes, 1000u);
    EXPECT_TRUE(IsHexDigest(e.file.sha256)) << e.file.sha256;
    std::set<std::string> files;
    for (const PackageFile& beside : e.beside) {
      EXPECT_TRUE(IsHexDigest(beside.sha256)) << beside.member;
      const std::string folder = e.file.member.substr(0, e.file.member.find_last_of("!/") + 1);
      EXPECT_TRUE(beside.member.starts_with(folder)) << beside.member;
      EXPECT_TRUE(files.insert(beside.member).second && beside.member != e.file.member) << beside.member;
    }
    const std::set<std::string> conversions{"", "grid", "globe", "module"};
    EXPECT_TRUE(conversions.count(e.conversion.kind)) << e.conversion.kind;
    EXPECT_EQ(e.conversion.kind.empty(), e.conversion.sha256.empty());
    EXPECT_TRUE(IsHexDigest(e.CachedSha256()));
    const std::set<std::string> formats{"obj", "off", "glb", "ply", "stl"};
    EXPECT_TRUE(formats.count(e.format)) << e.format;
    EXPECT_GE(e.triangles, 2000u);
    EXPECT_LE(e.triangles, 2'100'000u);
    // Attribution is what CC-BY asks for.
    EXPECT_FALSE(e.licence.starts_with("CC-BY") && e.author.empty());
    for (const Camera& camera : e.cameras) {
      EXPECT_NE(camera.eye, camera.at);
      EXPECT_GT(camera.tan_half_fov, 0.05f);
      EXPECT_LT(camera.tan_half_fov, 2.0f);
    }
  }
}

TEST(ManifestTest, EveryFamilyHasTwoModels) {
  std::map<std::string, int> count;
  for (const ManifestEntry& e : Manifest()) ++count[e.family];
  for (const std::string_view family : kModelFamilies) EXPECT_GE(count[std::string(family)], 2) << family;
}

TEST(ManifestTest, OnePackageIsOneDownload) {
  // Entries of one package agree on its client, versions and size.
  std::map<std::string, const ManifestEntry*> first;
  for (const ManifestEntry& e : Manifest()) {
    const ManifestEntry& other = *first.emplace(e.package, &e).first->second;
    EXPECT_EQ(e.client, other.client) << e.name;
    EXPECT_EQ(e.versions, other.versions) << e.name;
    EXPECT_EQ(e.package_bytes, other.package_bytes) << e.name;
  }
}

TEST(ManifestTest, ModelsAreFoundByNameAndByFamily) {
  EXPECT_EQ(&FindManifestEntry(Manifest()[1].name), &Manifest()[1]);
  ASSERT_EQ(FindModels("sponza").size(), 1u);
  EXPECT_EQ(FindModels("sponza")[0]->name, "sponza");
  const std::vector<const ManifestEntry*> scans = FindModels("scan");
  EXPECT_GE(scans.size(), 3u);
  for (const ManifestEntry* entry : scans) EXPECT_EQ(entry->family, "scan");
  const auto error = [](auto find) -> std::string {
    try {
      find("dragon\n");
    } catch (const InputError& e) {
      return e.what();
    }
    return {};
  };
  EXPECT_THAT(error([](const std::string& name) { FindManifestEntry(name); }),
              HasSubstr("'dragon'; see: raybench list models"));
  EXPECT_THAT(error([](const std::string& name) { FindModels(name); }), HasSubstr("the families indoor, "));
}

}  // namespace
}  // namespace raybench
