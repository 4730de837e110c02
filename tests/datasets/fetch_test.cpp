// SHA-256, the cache, and fetching with fake clients; models that are in the user's cache already are read
// and counted. Nothing here uses a network.

#include "datasets/models/fetch.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <optional>

#include "tests/support/datasets.h"
#include "tests/support/files.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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
  EXPECT_EQ(CachedFile(FindManifestEntry("engine")), "/own/models/engine/2CylinderEngine.glb");
  EXPECT_EQ(CachedFile(FindManifestEntry("maple")), "/own/models/maple/japaneseMaple.obj");
  EXPECT_EQ(CachedFile(FindManifestEntry("jacksboro")), "/own/models/jacksboro/jacksboro.ply");
}

TEST(CacheTest, UnfetchedAndBrokenModelsAreRefused) {
  ScratchDirectory files;
  ScopedVariable cache("RAYBENCH_CACHE", files.path().c_str());
  EXPECT_FALSE(IsFetched(FindManifestEntry("bunny")));
  EXPECT_THAT(LoadError("bunny"), HasSubstr("raybench fetch bunny"));
  fs::create_directories(files.path() / "models" / "bunny");
  files.Write("models/bunny/bunny00.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_TRUE(IsFetched(FindManifestEntry("bunny")));
  EXPECT_THAT(LoadError("bunny"), HasSubstr("SHA-256"));
}

constexpr char kModel[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

ManifestEntry MakeEntry(const std::string& name, const std::string& client, const std::string& package,
                        const std::string& member, const std::string& bytes = kModel) {
  ManifestEntry entry;
  entry.name = name, entry.doc = "a model", entry.family = "scan", entry.client = client;
  entry.package = package, entry.versions = {"1.0"}, entry.package_bytes = 1000;
  entry.file = {member, Sha256(bytes)};
  entry.licence = "CC0-1.0", entry.format = "obj", entry.triangles = 1;
  return entry;
}

/// A cache, and package clients that are shell scripts. Each call of a client adds a line to its log.
class FetchTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directory(files_.path() / "bin"); }

  void Script(const std::string& name, const std::string& body) {
    fs::permissions(files_.Write("bin/" + name, fmt::format("#!/bin/sh\necho \"$@\" >> {}/{}.log\n{}\n",
                                                            files_.path().string(), name, body)),
                    fs::perms::owner_all);
  }
  int Calls(const std::string& name) const {
    const std::string log = Read(files_.path() / (name + ".log"));
    return int(std::count(log.begin(), log.end(), '\n'));
  }
  /// npm as far as it is needed: `pack` makes a .tgz of what stands in `content`.
  void FakeNpm(const std::string& content) {
    Script("npm", fmt::format("tar -czf got.tgz -C {} .  --transform 's,^[.]/,,'", content));
  }
  std::vector<FetchResult> FetchAll(const std::vector<const ManifestEntry*>& models) {
    FetchListener listener;
    listener.say = [&](const std::string& line) { said_.push_back(line); };
    listener.progress = [&](double fraction, const std::string&) {
      EXPECT_GE(fraction, last_fraction_);
      EXPECT_LE(fraction, 1);
      last_fraction_ = fraction;
    };
    last_fraction_ = 0;
    return FetchModels(models, listener);
  }
  std::string Reason(const ManifestEntry& entry) {
    const FetchResult result = FetchAll({&entry}).front();
    EXPECT_EQ(result.reason.find('\n'), std::string::npos);
    EXPECT_EQ(result.reason.empty(), result.state != FetchResult::State::kFailed);
    EXPECT_EQ(result.state != FetchResult::State::kFailed, IsFetched(entry));
    return result.reason;
  }
  bool NothingIsLeftOver() const {
    if (fs::exists(cache_ / "packages")) return false;
    for (const auto& file : fs::directory_iterator(cache_ / "models"))
      if (file.path().filename().string().starts_with(".")) return false;
    return true;
  }

  ScratchDirectory files_;
  fs::path cache_ = files_.path() / "cache";
  ScopedVariable cache_variable_{"RAYBENCH_CACHE", cache_.c_str()};
  const std::string real_path_ = std::getenv("PATH");
  ScopedVariable path_{"PATH", ((files_.path() / "bin").string() + ":" + real_path_).c_str()};
  std::vector<std::string> said_;
  double last_fraction_ = 0;
};

using State = FetchResult::State;

TEST_F(FetchTest, OneDownloadServesAllModelsOfAPackage) {
  const fs::path content = files_.path() / "content";
  fs::create_directories(content / "package");
  files_.Write("content/package/a.obj", std::string("mtllib a.mtl\n") + kModel);
  files_.Write("content/package/a.mtl", "newmtl m\nKd 1 0 0\n");
  files_.Write("content/package/b.obj", kModel);
  FakeNpm(content.string());
  ManifestEntry a = MakeEntry("a", "npm", "p", "package/a.obj", std::string("mtllib a.mtl\n") + kModel);
  a.beside = {{"package/a.mtl", Sha256("newmtl m\nKd 1 0 0\n")}};
  a.author = "somebody";
  const ManifestEntry b = MakeEntry("b", "npm", "p", "package/b.obj");
  std::vector<FetchResult> results = FetchAll({&a, &b});
  EXPECT_EQ(results[0].state, State::kFetched) << results[0].reason;
  EXPECT_EQ(results[1].state, State::kFetched) << results[1].reason;
  EXPECT_EQ(Calls("npm"), 1);
  EXPECT_THAT(Read(files_.path() / "npm.log"), HasSubstr("p@1.0"));
  EXPECT_EQ(Read(cache_ / "models/a/a.mtl"), "newmtl m\nKd 1 0 0\n");
  EXPECT_EQ(FetchedVersion(a), "1.0");
  EXPECT_THAT(Read(cache_ / "models/a/record.json"), AllOf(HasSubstr("CC0-1.0"), HasSubstr("somebody")));
  EXPECT_TRUE(NothingIsLeftOver());
  VerifyFetched(a);

  // There and intact: no client is asked. A broken file beside the model is noticed and got again.
  results = FetchAll({&b, &a});
  EXPECT_EQ(results[0].state, State::kAlreadyThere);
  EXPECT_EQ(results[0].entry, &b);
  EXPECT_EQ(Calls("npm"), 1);
  files_.Write("cache/models/a/a.mtl", "newmtl other\n");
  EXPECT_THROW(VerifyFetched(a), InputError);
  results = FetchAll({&b, &a});
  EXPECT_EQ(results[0].state, State::kAlreadyThere);
  EXPECT_EQ(results[1].state, State::kFetched);
  EXPECT_EQ(Calls("npm"), 2);
  VerifyFetched(a);
}

TEST_F(FetchTest, ClientsThatAreMissingOrFailAreNamed) {
  const ManifestEntry entry = MakeEntry("model", "cargo", "crate", "media/model.obj");
  for (const auto& [client, program] : {std::pair("cargo", "cargo"), std::pair("npm", "npm"),
                                        std::pair("apt", "apt-get"), std::pair("pip", "python3")}) {
    ScopedVariable path("PATH", (files_.path() / "bin").c_str());
    EXPECT_THAT(Reason(MakeEntry("model", client, "crate", "x.obj")),
                HasSubstr(fmt::format("the program {} is needed", program)));
  }
  // Its word that says "error" is in the message, with the accepted versions.
  Script("cargo", "echo working; echo 'error: could not resolve host' >&2; echo bye; exit 101");
  EXPECT_THAT(Reason(entry),
              AllOf(HasSubstr("cargo could not get crate 1.0"), HasSubstr("error: could not resolve host")));
  EXPECT_TRUE(NothingIsLeftOver());
  // Of several versions the first that is to be had is taken.
  ManifestEntry two = entry;
  two.versions = {"0.9", "1.0"};
  Script("cargo",
         "grep -q 'crate = \"=1.0\"' Cargo.toml || exit 3\n"
         "mkdir -p vendor/crate/media && printf 'v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n' > "
         "vendor/crate/media/model.obj");
  EXPECT_EQ(Reason(two), "");
  EXPECT_EQ(FetchedVersion(two), "1.0");
  EXPECT_TRUE(NothingIsLeftOver());
  // Where the cache cannot be made, one line says so.
  ScopedVariable cache("RAYBENCH_CACHE", files_.Write("file", "").c_str());
  EXPECT_THROW(FetchAll({&entry}), InputError);
}

TEST_F(FetchTest, WrongContentIsRefused) {
  ManifestEntry entry = MakeEntry("model", "cargo", "crate", "media/model.obj");
  Script("cargo", "mkdir -p vendor/crate/media && echo 'v 0 0 0' > vendor/crate/media/model.obj");
  EXPECT_THAT(Reason(entry), HasSubstr("has SHA-256"));
  EXPECT_TRUE(NothingIsLeftOver());
  Script("cargo", "mkdir -p vendor/crate");
  EXPECT_THAT(Reason(entry), HasSubstr("has no file media/model.obj"));
  // One model of a package that is wrong does not keep the other away.
  Script("cargo", "mkdir -p vendor/crate/media && echo 'v 0 0 0' > vendor/crate/media/model.obj");
  const ManifestEntry other = MakeEntry("other", "cargo", "crate", "media/model.obj", "v 0 0 0\n");
  const std::vector<FetchResult> results = FetchAll({&entry, &other});
  EXPECT_EQ(results[0].state, State::kFailed);
  EXPECT_EQ(results[1].state, State::kFetched);
  EXPECT_TRUE(NothingIsLeftOver());
}

/// What the harness does with SIGINT.
volatile std::sig_atomic_t g_signals = 0;
extern "C" void CountSignal(int) { g_signals = g_signals + 1; }

TEST_F(FetchTest, AnInterruptedFetchGoesOn) {
  const auto old = std::signal(SIGINT, CountSignal);
  g_signals = 0;
  const fs::path content = files_.path() / "content";
  fs::create_directories(content);
  files_.Write("content/b.obj", kModel);
  Script("cargo",
         "mkdir -p vendor/crate && printf 'v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n' > vendor/crate/a.obj");
  const ManifestEntry a = MakeEntry("a", "cargo", "crate", "a.obj"), b = MakeEntry("b", "npm", "p", "b.obj");
  // The signal reaches raybench alone, while npm works: npm is ended, a stays.
  Script("npm", "kill -INT $PPID; exec sleep 60");
  try {
    FetchAll({&a, &b});
    ADD_FAILURE() << "not interrupted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("interrupted"));
  }
  EXPECT_EQ(g_signals, 1);  // raised again
  EXPECT_TRUE(IsFetched(a));
  EXPECT_FALSE(IsFetched(b));
  // The next is interrupted after the download: the package stays.
  FakeNpm(content.string());
  Script("tar", "test \"$1\" = -xf && { kill -INT $PPID; exec sleep 60; }; PATH='" + real_path_ +
                    "' exec tar \"$@\"");
  EXPECT_THROW(FetchAll({&a, &b}), InputError);
  EXPECT_EQ(g_signals, 2);
  EXPECT_TRUE(fs::exists(cache_ / "packages"));
  // The third call needs no client any more.
  fs::remove(files_.path() / "bin" / "tar");
  Script("npm", "exit 1");
  Script("cargo", "exit 1");
  const int calls = Calls("npm");
  const std::vector<FetchResult> results = FetchAll({&a, &b});
  EXPECT_EQ(results[0].state, State::kAlreadyThere);
  EXPECT_EQ(results[1].state, State::kFetched) << results[1].reason;
  EXPECT_EQ(Calls("npm"), calls);
  EXPECT_EQ(Calls("cargo"), 1);
  EXPECT_TRUE(NothingIsLeftOver());
  EXPECT_EQ(g_signals, 2);
  std::signal(SIGINT, old);
}

TEST_F(FetchTest, MembersOfArchivesInArchives) {
  // A zip in a tar in a wheel, which is a zip too.
  files_.Write(
      "make.py",
      "import io, sys, tarfile, zipfile\n"
      "model = sys.argv[1].encode()\n"
      "inner = io.BytesIO()\n"
      "with zipfile.ZipFile(inner, 'w') as z: z.writestr('deep/model.obj', model); z.writestr('deep/x.mtl', "
      "'newmtl x\\n')\n"
      "middle = io.BytesIO()\n"
      "with tarfile.open(fileobj=middle, mode='w:gz') as t:\n"
      "  info = tarfile.TarInfo('data/inner.sh3f'); info.size = len(inner.getvalue()); inner.seek(0); "
      "t.addfile(info, inner)\n"
      "with zipfile.ZipFile('got.whl', 'w') as z: z.writestr('share/data.tar.gz', middle.getvalue())\n");
  Script("python3",
         fmt::format(
             "PATH='{}'\nif test \"$2\" = pip; then exec python3 {}/make.py '{}'; fi\nexec python3 \"$@\"",
             real_path_, files_.path().string(), kModel));
  ManifestEntry entry =
      MakeEntry("model", "pip", "wheel", "share/data.tar.gz!data/inner.sh3f!deep/model.obj");
  entry.beside = {{"share/data.tar.gz!data/inner.sh3f!deep/x.mtl", Sha256("newmtl x\n")}};
  EXPECT_EQ(Reason(entry), "");
  EXPECT_EQ(Read(CachedFile(entry)), kModel);
  EXPECT_EQ(Read(cache_ / "models/model/x.mtl"), "newmtl x\n");
  entry.name = "none";
  entry.file.member = "share/data.tar.gz!data/inner.sh3f!deep/none.obj";
  EXPECT_THAT(Reason(entry), HasSubstr("inner.sh3f has no file deep/none.obj"));
  entry.file.member = "share/data.tar.gz!data/other.sh3f!deep/none.obj";
  EXPECT_THAT(Reason(entry), HasSubstr("data.tar.gz has no file data/other.sh3f"));
  EXPECT_TRUE(NothingIsLeftOver());
}

TEST_F(FetchTest, HeightFieldsAreConverted) {
  const std::string header = "{'descr': '<i2', 'fortran_order': False, 'shape': (2, 2)}";
  const std::string bytes = std::string("\x93NUMPY\x01\x00", 8) + char(header.size()) + '\0' + header +
                            std::string("\x01\x00\x02\x00\x03\x00\x04\x00", 8);
  fs::create_directories(files_.path() / "content");
  files_.Write("content/heights.npy", bytes);
  FakeNpm((files_.path() / "content").string());
  ManifestEntry entry = MakeEntry("field", "npm", "p", "heights.npy", bytes);
  entry.conversion = {"grid", {10, 10}, 1, std::string(64, '0')};
  entry.format = "ply";
  EXPECT_THAT(Reason(entry), HasSubstr("heights.npy, converted, has SHA-256"));
  EXPECT_TRUE(NothingIsLeftOver());
  const std::string reason = Reason(entry);
  entry.conversion.sha256 = reason.substr(reason.find("SHA-256 ") + 8, 64);
  EXPECT_EQ(Reason(entry), "");
  EXPECT_THAT(Read(cache_ / "models/field/field.ply"), HasSubstr("element vertex 4\n"));
}

TEST_F(FetchTest, WhatAnEarlierRaybenchFetchedIsFound) {
  const ManifestEntry entry = MakeEntry("model", "cargo", "crate", "media/thing.obj");
  const ManifestEntry broken = MakeEntry("broken", "cargo", "crate", "media/thing.obj");
  fs::create_directories(cache_ / "models");
  files_.Write("cache/models/model.obj", kModel);
  files_.Write("cache/models/model.json", "{\"version\": \"0.7\"}");
  files_.Write("cache/models/broken.obj", "v 0 0\n");
  files_.Write("cache/models/broken.json", "{\"version\": \"0.7\"}");
  Script("cargo", "exit 1");
  const std::vector<FetchResult> results = FetchAll({&entry, &broken});
  EXPECT_EQ(results[0].state, State::kAlreadyThere);
  EXPECT_EQ(FetchedVersion(entry), "0.7");
  EXPECT_EQ(Read(cache_ / "models/model/thing.obj"), kModel);
  EXPECT_EQ(results[1].state, State::kFailed);
  EXPECT_FALSE(fs::exists(cache_ / "models/model.obj"));
  EXPECT_FALSE(fs::exists(cache_ / "models/broken.obj"));
}

TEST(FetchedModelsTest, LoadModelsThatAreInTheCache) {
  int loaded = 0;
  for (const ManifestEntry& entry : Manifest()) {
    if (!IsFetched(entry)) continue;
    ++loaded;
    SCOPED_TRACE(entry.name);
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
