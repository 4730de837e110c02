// The forms in which programs write text files: byte-order marks, line ends, comments, blanks, letter case;
// what is left out and said; the hash that other programs compute; names of files.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cstring>

#include "accel/base/hash.h"
#include "tests/support/datasets.h"
#include "tests/support/gltf_builder.h"

namespace raybench {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

using Corner = std::array<uint32_t, 3>;

/// As tracer/rays/RAYS.md tells other programs to compute it.
std::string HashOfArrays(const std::vector<Vec3f>& positions, const std::vector<Corner>& triangles) {
  Hash64 hash;
  hash.AddValue(uint64_t{positions.size()});
  hash.AddValue(uint64_t{triangles.size()});
  hash.AddValue(uint64_t{0});
  hash.Add(positions.data(), positions.size() * sizeof(Vec3f));
  hash.Add(triangles.data(), triangles.size() * sizeof(Corner));
  return hash.Hex();
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (size_t i = text.find(from); i != text.npos; i = text.find(from, i + to.size()))
    text.replace(i, from.size(), to);
  return text;
}

const std::string kMark = "\xEF\xBB\xBF";

/// A square of two triangles and, where the format can say so, a vertex that nothing uses; text that ends in
/// a line break.
struct TextForm {
  const char* file;
  std::string text;
  const char* comment;  ///< a line that says nothing; empty: the format has none
  std::vector<Vec3f> positions;
  std::vector<Corner> triangles;
};

std::vector<TextForm> TextForms() {
  const std::vector<Vec3f> square{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  std::vector<Vec3f> five = square, six;
  five.push_back({9, 9, 9});
  const std::vector<Corner> two{{0, 1, 2}, {0, 2, 3}};
  for (const Corner& t : two)
    for (uint32_t v : t) six.push_back(square[v]);
  std::string stl = "solid a name\n";
  for (const Corner& t : two) {
    stl += "facet normal 0 0 1\nouter loop\n";
    for (uint32_t v : t) stl += fmt::format("vertex {} {} 0\n", square[v].x, square[v].y);
    stl += "endloop\nendfacet\n";
  }
  return {
      {"form.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 9 9 9\nf 1 2 3\nf 1 3 4\n", "# said\n", five, two},
      {"form.off", "OFF\n5 2 0\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n9 9 9\n3 0 1 2\n3 0 2 3\n", "# said\n", five,
       two},
      {"form.ply",
       "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
       "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
       "0 0 0\n2 0 0\n2 2 0\n0 2 0\n9 9 9\n3 0 1 2\n3 0 2 3\n",
       "comment said\n", five, two},
      {"form.stl", stl + "endsolid a name\n", "", six, {{0, 1, 2}, {3, 4, 5}}},
      {"form.nff", "p 3\n0 0 0\n2 0 0\n2 2 0\np 3\n0 0 0\n2 2 0\n0 2 0\n", "# said\n", square, two}};
}

class TextFormsTest : public ::testing::Test {
 protected:
  ScratchDirectory files_;
};

TEST_F(TextFormsTest, EveryMarkLineEndAndBlankInEveryFormat) {
  int cases = 0;
  for (const TextForm& form : TextForms()) {
    const std::string hash = HashOfArrays(form.positions, form.triangles);
    for (const std::string& mark : {std::string(), kMark})
      for (const std::string end : {"\n", "\r\n", "\r", "\n\r"})
        for (const bool has_last_end : {true, false})
          for (const std::string blanks : {"", " ", "\t ", " \v"})
            for (const int extra : {0, 1, 2}) {  // comments and blank lines
              std::string text = form.text;
              if (extra > 0) {
                const std::string line = extra == 1 ? form.comment : "\n";
                const size_t first = text.find('\n') + 1, last = text.rfind('\n', text.size() - 2) + 1;
                if (std::string(form.file) != "form.ply") text.insert(last, line);
                text.insert(first, line);
              }
              if (!has_last_end) text.pop_back();
              text = mark + Replaced(text, "\n", blanks + end);
              SCOPED_TRACE(fmt::format("{} mark {} end {} last {} blanks {} extra {}", form.file, mark.size(),
                                       Replaced(Replaced(end, "\r", "CR"), "\n", "LF"), has_last_end,
                                       blanks.size(), extra));
              const Scene scene = LoadScene(files_.Write(form.file, text));
              ASSERT_EQ(scene.triangles.size(), 2u);
              EXPECT_EQ(scene.bounds().lo, (Vec3f{0, 0, 0}));
              EXPECT_EQ(scene.bounds().hi, (Vec3f{2, 2, 0}));
              EXPECT_EQ(scene.hash(), hash);
              EXPECT_THAT(scene.stats.notes, IsEmpty());
              ++cases;
            }
  }
  EXPECT_EQ(cases, 5 * 2 * 4 * 2 * 4 * 3);
}

TEST_F(TextFormsTest, LineEndsThatChangeWithinAFile) {
  const Scene scene =
      LoadScene(files_.Write("mixed.obj", "v 0 0 0\rv 2 0 0\nv 2 2 0\r\nv 0 2 0\r\rf 1 2 3\rf 1 3 4"));
  EXPECT_EQ(scene.triangles.size(), 2u);
  EXPECT_EQ(scene.positions.size(), 4u);
}

TEST_F(TextFormsTest, KeywordsOfStlInAnyCase) {
  for (const TextForm& form : TextForms()) {
    if (std::string(form.file) != "form.stl") continue;
    std::string upper = form.text;
    for (char& c : upper) c = char(std::toupper(static_cast<unsigned char>(c)));
    EXPECT_EQ(LoadScene(files_.Write("upper.stl", upper)).hash(),
              HashOfArrays(form.positions, form.triangles));
  }
}

TEST_F(TextFormsTest, WideTextIsNamed) {
  for (const std::string name : {"w.obj", "w.off", "w.ply", "w.stl", "w.nff", "w.gltf"})
    for (const bool has_mark : {true, false})
      for (const bool is_big : {true, false}) {
        std::string text = has_mark ? is_big ? "\xFE\xFF" : "\xFF\xFE" : "";
        for (char c : std::string(name == "w.gltf" ? "{\"asset\":{}}" : "solid v 0 0 0")) {
          if (is_big) text += '\0';
          text += c;
          if (!is_big) text += '\0';
        }
        if (!has_mark && (name == "w.ply" || name == "w.stl" || name == "w.gltf"))
          continue;  // refused otherwise
        EXPECT_THAT(LoadError(files_.Write(name, text)), HasSubstr("UTF-16")) << name << has_mark << is_big;
      }
  files_.Write("w.mtl", "\xFF\xFEn");
  const Scene scene = LoadScene(files_.Write("m.obj", "mtllib w.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  EXPECT_THAT(scene.stats.notes,
              ElementsAre(AllOf(HasSubstr("the material file 'w.mtl' cannot be read"), HasSubstr("UTF-16"))));
}

TEST_F(TextFormsTest, MaterialsInEveryForm) {
  for (const std::string& mark : {std::string(), kMark})
    for (const std::string end : {"\n", "\r\n", "\r"}) {
      files_.Write("my colours.mtl", mark + Replaced("newmtl red one\nKd 1 0 0\n", "\n", end));
      const std::string obj = "mtllib my colours.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red one\nf 1 2 3\n";
      const Scene scene = LoadScene(files_.Write("m.obj", mark + Replaced(obj, "\n", end)));
      EXPECT_EQ(scene.materials.at(scene.MaterialOf(0)).diffuse, (Vec3f{1, 0, 0}));
      EXPECT_THAT(scene.stats.notes, IsEmpty());
    }
}

TEST_F(TextFormsTest, BinaryPlyUnderEveryHeader) {
  std::string data;
  const float positions[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  data.append(reinterpret_cast<const char*>(positions), sizeof positions);
  // First bytes that look like line ends must stay data: an index count comes after the positions, so put the
  // faces first.
  for (const std::string& mark : {std::string(), kMark})
    for (const std::string end : {"\n", "\r\n", "\r", "\n\r"})
      for (const uint8_t first : {'\n', '\r'}) {
        const std::string header = Replaced(
            "ply\nformat binary_little_endian 1.0\nelement junk 1\nproperty uchar junk\nelement vertex 4\n"
            "property float x\nproperty float y\nproperty float z\nelement face 1\n"
            "property list uchar uchar vertex_indices\nend_header\n",
            "\n", end);
        // "\r" before a line feed of data would be another line end.
        if (end == "\r" && first == '\n') continue;
        const std::string faces{3, 0, 1, 3};
        const Scene scene = LoadScene(files_.Write("b.ply", mark + header + char(first) + data + faces));
        EXPECT_THAT(scene.triangles, ElementsAre(Corner{0, 1, 3})) << end.size() << int(first);
        EXPECT_EQ(scene.positions[3], (Vec3f{0, 0, 1}));
        EXPECT_THAT(scene.stats.notes, ElementsAre("left out: 1 of element 'junk'"));
      }
}

TEST_F(TextFormsTest, StlInOtherLayouts) {
  const std::string facet =
      "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet ";
  const auto triangles = [&](const std::string& text) {
    return LoadScene(files_.Write("s.stl", text)).triangles.size();
  };
  EXPECT_EQ(triangles("solid n " + facet + "endsolid n\n"), 1u);
  EXPECT_EQ(triangles("solid " + facet + facet + "endsolid"), 2u);
  EXPECT_EQ(triangles("solid a facet " + facet + "endsolid a solid b c " + facet + facet + "endsolid b c\n"),
            3u);
  EXPECT_EQ(triangles("solid a\n" + facet + "\nendsolid a\nsolid b\n" + facet + "\nendsolid\n"), 2u);
  EXPECT_EQ(triangles("solid endless facet\n" + facet + "\nendsolid endless facet\n"), 1u);
  std::string spaced = Replaced(Replaced(facet, "endloop", "end loop"), "endfacet", "End Facet");
  EXPECT_EQ(triangles("solid n\n" + spaced + "\nend solid n\n"), 1u);
  EXPECT_THAT(LoadError(files_.Write("s.stl", "solid n\n" + Replaced(facet, "endloop", "end lop"))),
              HasSubstr("facet 0 has 'end' where 'endloop' is needed"));
  EXPECT_THAT(LoadError(files_.Write("s.stl", "solid n\n" + facet)), HasSubstr("'endsolid' is missing"));
}

TEST_F(TextFormsTest, WhatIsLeftOutIsSaidOnce) {
  const std::string v = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  const auto notes = [&](const std::string& text) {
    return LoadScene(files_.Write("o.obj", text)).stats.notes;
  };
  EXPECT_THAT(notes("g a\no b\ns 1\nmg 1\nlod 2\n# c\n" + v + "f 1 2 3\n"), IsEmpty());
  EXPECT_THAT(
      notes(v + "f 1 2 3\ncstype rat bspline\ndeg 2 2\ncurv 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n"),
      ElementsAre("left out: cstype, curv, deg, end, parm (2)"));
  EXPECT_THAT(notes(v + "p 1 2\nl 1 2\nl 2 3\ncall other.obj\nf 1 2 3\nwhatever\n"),
              ElementsAre("left out: call, l (2), p, whatever"));
  EXPECT_THAT(
      notes(v + "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\nusemtl a\nf 2 3 4\n"),
      ElementsAre("left out: usemtl of the unknown material 'a' (2), usemtl of the unknown material 'b'"));
  EXPECT_EQ(LoadScene(files_.Write("o.obj", v + "fo 1 2 3\nf 1 2 3\n")).triangles.size(), 2u);
  EXPECT_THAT(LoadError(files_.Write("o.obj", v + "surf 0 1 0 1 1 2 3 4\n")),
              HasSubstr("has no faces (left out: surf)"));

  files_.Write("o.mtl", "Kd 1 0 0\nnewmtl a\nKa 1 1 1\nKd red\nPr 0.5\nPm 0\nPr 1\n");
  EXPECT_THAT(notes("mtllib o.mtl\n" + v + "usemtl a\nf 1 2 3\n"),
              ElementsAre("o.mtl: statements not followed: Kd before the first newmtl, Pm, Pr (2)",
                          "o.mtl: statements passed over, for their values do not parse: Kd"));
  const Scene off =
      LoadScene(files_.Write("c.off", "COFF\n3 1 0\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n0 1 0\n3 0 1 2 9 9 9\n"));
  EXPECT_THAT(off.stats.notes, ElementsAre("left out: what follows the positions of 2 vertices",
                                           "left out: what follows the corners of 1 faces"));
  const Scene ply = LoadScene(files_.Write(
      "c.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty float nx\nelement edge 2\nproperty int a\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0 1 0\n1 0 0 1 0\n0 1 0 1 0\n1\n2\n3 0 1 "
      "2\n"));
  EXPECT_THAT(ply.stats.notes, ElementsAre("left out: properties of vertex: nx, red; 2 of element 'edge'"));
}

TEST_F(TextFormsTest, WhatDropBadCouldDoIsNamed) {
  const std::string bad = "(--drop-bad leaves out what has or uses it)";
  LoadOptions drop;
  drop.drop_bad = true;
  const auto expect = [&](const std::string& name, const std::string& text) {
    const std::string path = files_.Write(name, text);
    EXPECT_THAT(LoadError(path), HasSubstr(bad)) << name;
    EXPECT_EQ(LoadScene(path, drop).primitive_count(), 1u) << name;
  };
  expect("n.obj", "v 0 0 0\nv 1 0 0\nv nan nan nan\nv 0 1 0\nf 1 2 4\n");  // not even used
  expect("i.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n");
  expect("n.off", "OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\ninf 0 0\n3 0 1 2\n");
  expect("i.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 3\n");
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
  expect("n.ply", ply + "nan 0 0\n3 0 1 2\n3 0 1 3\n");
  expect("i.ply", ply + "2 0 0\n3 0 1 2\n3 0 1 7\n");
  const std::string facet =
      "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
  expect("n.stl", "solid\n" + facet + Replaced(facet, "1 0 0", "inf 0 0") + "endsolid\n");
  expect("n.nff", "s 0 0 0 1\ns nan 0 0 1\n");
  expect("z.nff", "s 0 0 0 1\ns 0 0 0 0\n");
}

TEST_F(TextFormsTest, HashIsOfTheArraysOfTheFile) {
  struct Mesh {
    std::vector<Vec3f> positions;
    std::vector<Corner> triangles;
    size_t kept;  ///< the rest is degenerate
    uint32_t first_face;
  };
  const Vec3f o{0, 0, 0}, x{1, 0, 0}, y{0, 1, 0};
  const std::vector<Mesh> meshes = {
      {{o, x, y}, {{0, 0, 1}, {0, 1, 2}}, 1, 1}, {{o, x, y}, {{0, 1, 0}, {0, 1, 2}}, 1, 1},
      {{o, x, y}, {{0, 1, 1}, {0, 1, 2}}, 1, 1}, {{o, x, y}, {{0, 0, 0}, {0, 1, 2}, {2, 2, 2}}, 1, 1},
      {{o, x, y}, {{0, 1, 2}, {0, 0, 1}}, 1, 0}, {{o, x, y, {2, 0, 0}}, {{0, 1, 3}, {0, 1, 2}}, 1, 1},
      {{o, x, y, {7, 7, 7}}, {{0, 1, 2}}, 1, 0}, {{o, x, y, o}, {{3, 1, 2}, {0, 1, 2}}, 2, 0}};
  for (const Mesh& m : meshes) {
    std::string obj, off = fmt::format("OFF\n{} {} 0\n", m.positions.size(), m.triangles.size()),
                     ply = fmt::format(
                         "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
                         "property float z\nelement face {}\nproperty list uchar int vertex_indices\n"
                         "end_header\n",
                         m.positions.size(), m.triangles.size());
    for (Vec3f p : m.positions) {
      const std::string line = fmt::format("{} {} {}\n", p.x, p.y, p.z);
      obj += "v " + line, off += line, ply += line;
    }
    for (const Corner& t : m.triangles) {
      obj += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
      off += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]),
          ply += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
    }
    for (const auto& [name, text] : {std::pair{"h.obj", obj}, {"h.off", off}, {"h.ply", ply}}) {
      SCOPED_TRACE(fmt::format("{} {}", name, obj));
      const Scene scene = LoadScene(files_.Write(name, text));
      EXPECT_EQ(scene.hash(), HashOfArrays(m.positions, m.triangles));
      EXPECT_EQ(scene.triangles.size(), m.kept);
      EXPECT_EQ(scene.triangle_face.front(), m.first_face);
      EXPECT_EQ(scene.stats.degenerate_triangles, m.triangles.size() - m.kept);
    }
  }
}

TEST_F(TextFormsTest, HashOfBadGeometryIsTheFilesToo) {
  LoadOptions drop;
  drop.drop_bad = true;
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const std::vector<Vec3f> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {kInf, 0, 0}};
  const std::string hash = HashOfArrays(positions, {{0, 1, 2}, {0, 1, 3}});
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
  for (const auto& [name, text] : {std::pair<const char*, std::string>{
                                       "b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv inf 0 0\nf 1 2 3\nf 1 2 4\n"},
                                   {"b.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\ninf 0 0\n3 0 1 2\n3 0 1 3\n"},
                                   {"b.ply", ply + "0 0 0\n1 0 0\n0 1 0\ninf 0 0\n3 0 1 2\n3 0 1 3\n"}})
    EXPECT_EQ(LoadScene(files_.Write(name, text), drop).hash(), hash) << name;
}

TEST_F(TextFormsTest, HashOfStlIsOfItsCornersNotOfWhatIsWelded) {
  const std::vector<Vec3f> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, -0.0f}};
  std::string text = "solid\n", binary(80, ' ');
  binary += std::string("\2\0\0\0", 4);
  for (size_t i = 0; i < 6; ++i) {
    if (i % 3 == 0) text += "facet normal 0 0 1\nouter loop\n", binary += std::string(12, '\0');
    text += fmt::format("vertex {} {} {}\n", corners[i].x, corners[i].y, corners[i].z);
    binary.append(reinterpret_cast<const char*>(&corners[i]), 12);
    if (i % 3 == 2) text += "endloop\nendfacet\n", binary += std::string(2, '\0');
  }
  for (const std::string& file :
       {files_.Write("t.stl", text + "endsolid\n"), files_.Write("b.stl", binary)}) {
    const Scene scene = LoadScene(file);
    EXPECT_EQ(scene.hash(), HashOfArrays(corners, {{0, 1, 2}, {3, 4, 5}})) << file;
    EXPECT_EQ(scene.positions.size(), 4u);
    EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1));
  }
}

TEST_F(TextFormsTest, HashDoesNotDependOnPictures) {
  files_.Write("there.png", "\x89PNG");
  files_.Write("t.mtl", "newmtl with\nmap_Kd there.png\nnewmtl without\nmap_Kd missing.png\n");
  std::string hash;
  for (const std::string material : {"with", "without", "unknown"})
    for (const bool keep : {true, false}) {
      LoadOptions options;
      options.keep_unread = keep;
      const Scene scene = LoadScene(
          files_.Write("t.obj", "mtllib t.mtl\nusemtl " + material +
                                    "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt .5 .5\n"
                                    "vn 0 0 1\nvn 0 1 1\nf 1/1/1 2/2/2 3/3/1\nf 2/4/1 4/1/1 3/2/2\n"),
          options);
      EXPECT_EQ(scene.hash(),
                HashOfArrays({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2}, {1, 3, 2}}))
          << material << keep;
      if (material == "with") {
        EXPECT_GT(scene.positions.size(), 4u);
      }
    }
}

TEST_F(TextFormsTest, HashOfGltfDoesNotDependOnPicturesEither) {
  const auto load = [&](const std::string& picture) {
    GltfBuilder b;
    const int p = b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0}), other = b.Positions({0, 0, 1, 1, 0, 1, 0, 1, 1});
    for (const std::vector<float>& uv : {std::vector<float>{0, 0, 1, 0, 0, 1}, {0, 0, 0, 1, 1, 0}}) {
      const int coordinates = b.Accessor(Bytes(uv), "VEC2", 5126, 3);
      nlohmann::json& primitive = b.Primitive(p);
      primitive["attributes"]["TEXCOORD_0"] = coordinates;
      primitive["material"] = 0;
    }
    b.Primitive(other);
    b.root["images"] = {{{"uri", picture}}};
    b.root["textures"] = {{{"source", 0}}};
    b.root["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    return LoadScene(files_.Write("p.gltf", b.Text()));
  };
  files_.Write("there.png", "\x89PNG\r\n\x1a\n");
  const std::string hash = HashOfArrays({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}},
                                        {{0, 1, 2}, {0, 1, 2}, {3, 4, 5}});
  const Scene with = load("there.png"), without = load("missing.png");
  EXPECT_EQ(with.positions.size(), 9u);
  EXPECT_EQ(with.hash(), hash);
  EXPECT_EQ(without.hash(), hash);
}

TEST_F(TextFormsTest, AFileIsAFileWhateverItIsCalled) {
  const std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  std::filesystem::current_path(files_.path());
  for (const std::string name : {"bunny(1).obj", "model (1).obj", "terrain(size=100).obj", "subdivide(a).obj",
                                 "a,b.obj", "a=b,c=d.obj", "(.obj", ").obj", "h\xC3\xA4user.obj",
                                 "\xE6\x97\xA5\xE6\x9C\xAC.obj", "bunny.obj", "two words.OBJ"}) {
    SCOPED_TRACE(name);
    files_.Write(name, text);
    for (const std::string& scene : {name, "./" + name, (files_.path() / name).string()}) {
      EXPECT_EQ(LoadScene(scene).triangles.size(), 1u);
      EXPECT_EQ(LoadScene(scene).name, name);
      EXPECT_EQ(LoadScene("subdivide(" + scene + ")").triangles.size(), 4u);
      EXPECT_EQ(LoadScene("subdivide( " + scene + " , levels=2)").triangles.size(), 16u);
    }
  }
  EXPECT_EQ(LoadScene("subdivide(subdivide(a,b.obj),levels=1)").triangles.size(), 16u);
  std::filesystem::current_path("/");
  EXPECT_THAT(LoadError("bunny(2).obj"), HasSubstr("no such file"));
  EXPECT_EQ(LoadScene("icosphere(level=1)").triangles.size(), 80u);
}

TEST_F(TextFormsTest, GltfVersionThatIsNeededAndNodesThatAreNotVisible) {
  const auto with = [&](const std::string& asset, const std::string& nodes) {
    const float p[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    files_.Write("p.bin", std::string(reinterpret_cast<const char*>(p), sizeof p));
    return files_.Write(
        "v.gltf",
        "{\"asset\":{" + asset + "},\"scenes\":[{\"nodes\":[0,1]}],\"nodes\":[" + nodes +
            "],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
            "\"buffers\":[{\"uri\":\"p.bin\",\"byteLength\":36}],\"bufferViews\":[{\"buffer\":0,"
            "\"byteLength\":36}],"
            "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],"
            "\"extensionsUsed\":[\"KHR_node_visibility\"],\"extensionsRequired\":[\"KHR_node_visibility\"]}");
  };
  const auto node = [](const std::string& visible, const std::string& more = "") {
    return "{\"mesh\":0" + more +
           (visible.empty() ? "" : ",\"extensions\":{\"KHR_node_visibility\":{" + visible + "}}") + "}";
  };
  const std::string v2 = "\"version\":\"2.0\"", shown = node(""), hidden = node("\"visible\":false");
  EXPECT_EQ(LoadScene(with(v2, shown + "," + shown)).triangles.size(), 2u);
  EXPECT_EQ(LoadScene(with(v2 + ",\"minVersion\":\"2.0\"", shown + "," + node(""))).triangles.size(), 2u);
  EXPECT_EQ(LoadScene(with("\"version\":\"2.1\"", shown + "," + shown)).triangles.size(), 2u);
  EXPECT_THAT(LoadError(with("\"version\":\"2.1\",\"minVersion\":\"2.1\"", shown + "," + shown)),
              HasSubstr("is glTF 2.1 (asset.minVersion); 2.0 is read"));
  EXPECT_EQ(LoadScene(with(v2, shown + "," + node("\"visible\":true"))).triangles.size(), 2u);
  EXPECT_EQ(LoadScene(with(v2, shown + "," + node("\"extras\":1"))).triangles.size(), 2u);
  const Scene one = LoadScene(with(v2, shown + "," + hidden));
  EXPECT_EQ(one.triangles.size(), 1u);
  EXPECT_THAT(one.stats.notes, ElementsAre("left out: 1 mesh of a node that is not visible"));
  // What lies below a hidden node is hidden, whatever it says itself.
  const Scene below = LoadScene(with(
      v2, shown + "," + node("\"visible\":false", ",\"children\":[2]") + "," + node("\"visible\":true")));
  EXPECT_EQ(below.triangles.size(), 1u);
  EXPECT_THAT(below.stats.notes, ElementsAre("left out: 2 meshes of nodes that are not visible"));
  EXPECT_THAT(LoadError(with(v2, shown + "," + node("\"visible\":1"))), HasSubstr("true or false is needed"));
}

}  // namespace
}  // namespace raybench
