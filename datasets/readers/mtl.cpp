#include "datasets/readers/mtl.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

#include "datasets/readers/text_reader.h"

namespace raybench {
namespace {

constexpr Vec3f kWhite{1, 1, 1};

/// The statements of one material as they stand in the file.
struct Statements {
  Vec3f kd = Material().diffuse, ks{0, 0, 0}, ke{0, 0, 0};
  std::optional<Vec3f> tf;
  float ns = Material().shininess, ni = Material().ior;
  float opacity = 1;
  int illum = 2;
  MtlMap map_kd, map_ke;
};

/// The illumination models of the format, as near as the scene's model comes (MATERIALS.md).
MtlMaterial ToModel(const Statements& s) {
  const bool refracts = s.illum == 6 || s.illum == 7;
  // The refracting models weigh what passes by Tf; the others dissolve, without colour and without
  // bending it.
  const Vec3f through = refracts && s.tf ? *s.tf : kWhite * (1 - s.opacity);
  const bool transmits = !IsBlack(through);

  MtlMaterial out{{}, s.map_kd, s.map_ke};
  Material& m = out.material;
  m.diffuse = s.kd * (kWhite - through);
  if (s.illum >= 2) m.specular = s.ks;
  m.shininess = s.ns;
  m.emission = s.ke;
  m.ior = s.ni;
  m.thin = transmits && !refracts;
  m.fresnel = s.illum == 5 || s.illum == 7;
  // In a clear body Fresnel's equations say how much is mirrored.
  if (s.illum >= 3 && s.illum <= 9 && !(s.illum == 7 && transmits)) m.reflect = s.ks;
  m.transmit = through * (kWhite - m.reflect);
  if (s.illum == 0) {  // Kd as it is, whatever the light
    m.emission = m.emission + m.diffuse;
    m.diffuse = {0, 0, 0};
    out.emission = s.map_kd;
  }
  return out;
}

/// One number for all channels, or three. Negative ones count as 0.
std::optional<Vec3f> Color(Words words, float most) {
  float x[3];
  int n = 0;
  while (n < 3 && ParseNumber(words.Next(), x[n]) == Number::kFinite) ++n;
  if (n == 0) return {};
  const auto channel = [&](int i) { return std::clamp(x[n == 3 ? i : 0], 0.0f, most); };
  return Vec3f{channel(0), channel(1), channel(2)};
}

std::optional<float> Scalar(Words words, float least, float most) {
  std::string_view word = words.Next();
  if (word == "-halo") word = words.Next();  // of `d`: thicker at the rim
  float x;
  if (ParseNumber(word, x) != Number::kFinite) return {};
  return std::clamp(x, least, most);
}

/// `Tr` as an opacity.
std::optional<float> Transparency(Words words) {
  const std::optional<float> transparency = Scalar(words, 0, 1);
  return transparency ? std::optional(1 - *transparency) : std::nullopt;
}

/// `illum`.
std::optional<int> Model(Words words) {
  const std::optional<float> model = Scalar(words, 0, 10);
  return model ? std::optional(int(*model)) : std::nullopt;
}

/// What may stand before the file's name of a texture statement.
struct Option {
  std::string_view name;
  bool numbers;    ///< takes up to three numbers; else one word
  float identity;  ///< numbers that change nothing
};
constexpr Option kOptions[] = {{"-s", true, 1},       {"-o", true, 0},       {"-t", true, 0},
                               {"-mm", true, -1},     {"-bm", false, 0},     {"-boost", false, 0},
                               {"-blendu", false, 0}, {"-blendv", false, 0}, {"-cc", false, 0},
                               {"-clamp", false, 0},  {"-type", false, 0},   {"-imfchan", false, 0},
                               {"-texres", false, 0}};

class MtlReader : TextReader {
 public:
  MtlReader(const std::filesystem::path& path, const LoadOptions& options, Scene& scene, MtlLibrary& library)
      : TextReader(path, ReadText(path), options, scene), library_(library) {}

  void Run() {
    Words words("");
    for (std::string_view key; NextStatement(key, words);) {
      if (key == "newmtl") {
        CloseMaterial();
        name_ = words.Rest();
        statements_ = {};
        is_open_ = true;
      } else if (is_open_) {
        Statement(key, words);
      } else {
        unused_.Add(fmt::format("{} before the first newmtl", key));
      }
    }
    CloseMaterial();
    if (!ignored_.empty()) Note("textures not applied", Joined(ignored_));
    if (!skipped_.empty()) Note("options of textures not applied", Joined(skipped_));
    if (!unused_.empty()) Note("statements not followed", unused_.Text());
    if (!malformed_.empty()) Note("statements passed over, for their values do not parse", malformed_.Text());
  }

 private:
  void CloseMaterial() {
    if (!is_open_) return;
    MtlMaterial& material = library_[name_] = ToModel(statements_);
    material.material.name = name_;
  }

  void Statement(std::string_view key, const Words& words) {
    Statements& s = statements_;
    const auto set = [&](auto& to, const auto& value) { value ? void(to = *value) : malformed_.Add(key); };
    if (key == "Kd")
      set(s.kd, Color(words, 1));
    else if (key == "Ks")
      set(s.ks, Color(words, 1));
    else if (key == "Tf")
      set(s.tf, Color(words, 1));
    else if (key == "Ke")
      set(s.ke, Color(words, 1e30f));
    else if (key == "Ns")
      set(s.ns, Scalar(words, 1, 1e4f));
    else if (key == "Ni")
      set(s.ni, Scalar(words, 1, 10));
    else if (key == "d")
      set(s.opacity, Scalar(words, 0, 1));
    else if (key == "Tr")
      set(s.opacity, Transparency(words));
    else if (key == "illum")
      set(s.illum, Model(words));
    else if (key == "map_Kd")
      s.map_kd = Map(words);
    else if (key == "map_Ke")
      s.map_ke = Map(words);
    else if (key.starts_with("map_") || key == "bump" || key == "disp" || key == "decal" || key == "refl" ||
             key == "norm")
      ignored_.insert(std::string(key));
    else if (key != "Ka")  // MATERIALS.md
      unused_.Add(key);
  }

  /// The options and the file's name, which may have blanks, of a texture statement. Options that would move
  /// or change the picture are noted.
  MtlMap Map(Words words) {
    MtlMap map;
    for (Words ahead = words;; words = ahead) {
      const std::string_view name = ahead.Next();
      const auto* option = std::find_if(std::begin(kOptions), std::end(kOptions),
                                        [&](const Option& o) { return o.name == name; });
      if (option == std::end(kOptions)) break;
      if (!option->numbers) {
        const std::string_view value = ahead.Next();
        if (name == "-clamp" && value == "on") map.wrap = TextureWrap::kClampToEdge;
        continue;
      }
      float x;
      Words next = ahead;
      for (int i = 0; i < 3 && ParseNumber(next.Next(), x) == Number::kFinite; ++i, ahead = next)
        if (x != option->identity) skipped_.insert(std::string(name));
    }
    std::string file(words.Rest());
    std::replace(file.begin(), file.end(), '\\', '/');  // as some systems write it
    if (!file.empty()) map.file = path_.parent_path() / file;
    return map;
  }

  void Note(const char* what, const std::string& items) {
    scene_.stats.notes.push_back(OneLine(fmt::format("{}: {}: {}", path_.filename().string(), what, items)));
  }
  static std::string Joined(const std::set<std::string, std::less<>>& items) {
    return fmt::format("{}", fmt::join(items, ", "));
  }

  MtlLibrary& library_;
  Statements statements_;
  std::string name_;
  bool is_open_ = false;
  std::set<std::string, std::less<>> ignored_, skipped_;
  Counts unused_, malformed_;
};

}  // namespace

void ReadMtl(const std::filesystem::path& path, const LoadOptions& options, Scene& scene,
             MtlLibrary& library) {
  MtlReader(path, options, scene, library).Run();
}

}  // namespace raybench
