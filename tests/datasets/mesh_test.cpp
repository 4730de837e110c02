// OBJ and OFF files.

#include <gmock/gmock.h>

#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Triangle = std::array<uint32_t, 3>;

class MeshTest : public ::testing::Test {
 protected:
  Scene Obj(const std::string& text, const LoadOptions& options = {}) {
    return LoadScene(files_.Write("model.obj", text), options);
  }
  Scene Off(const std::string& text, const LoadOptions& options = {}) {
    return LoadScene(files_.Write("model.off", text), options);
  }
  std::string ObjError(const std::string& text) { return LoadError(files_.Write("model.obj", text)); }
  std::string OffError(const std::string& text) { return LoadError(files_.Write("model.off", text)); }
  ScratchDirectory files_;
};

const char kSquare[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST_F(MeshTest, TrianglesKeepTheirFace) {
  Scene scene = Obj(std::string(kSquare) + "v 0.5 0.5 1\nf 1 2 3 4\nf 1 2 5\nf 1 3 5 4\n");
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 4},
                                           Triangle{0, 2, 4}, Triangle{0, 4, 3}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 0, 1, 2, 2));
  EXPECT_EQ(scene.stats.faces, 3u);
  EXPECT_EQ(scene.positions[4], (Vec3f{0.5f, 0.5f, 1}));
  EXPECT_EQ(scene.name, "model.obj");
}

TEST_F(MeshTest, NonManifoldFacesStayInOrder) {
  // One edge with four faces, one of them twice and one turned round.
  std::string text = "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\n";
  Scene scene = Obj(text + "f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 2 4\nf 2 1 4\n");
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 3}, Triangle{0, 1, 4},
                                           Triangle{0, 1, 3}, Triangle{1, 0, 3}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(scene.positions.size(), 5u);
}

TEST_F(MeshTest, IndicesOfEveryKind) {
  Scene scene = Obj(
      "# a comment\r\nmtllib none.mtl\nv\t0 0 0 1.0\r\nv 1 0 0 0.5 0.5 0.5\nvt 0 0\nvn 0 0 1\nv 0 1 0 # 7 8\n"
      "g group\nf -3 -2 -1\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1 # 4\nf 1/1/1 2/1/1 \\\n 3/1/1\nl 1 2\np 1\nf 1 2 "
      "4\nv 0 0 1\n"
      "f -1 +1 2");
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 2}, Triangle{0, 1, 2},
                                           Triangle{0, 1, 2}, Triangle{0, 1, 3}, Triangle{3, 0, 1}));
  EXPECT_EQ(scene.positions.size(), 4u);
}

TEST_F(MeshTest, RepeatedAndMissingCornersAreDegenerate) {
  Scene scene = Obj(std::string(kSquare) + "f 1 1 2\nf 1 2\nf 1 2 2 3\nf 1 2 3\nf 1 2 1 2\n");
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 2}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(2, 3));
  EXPECT_EQ(scene.stats.faces, 5u);
  EXPECT_EQ(scene.stats.degenerate_triangles, 1u + 1u + 1u + 2u);
}

TEST_F(MeshTest, PolygonsOfAnyShape) {
  const std::string arrow = "v 0 0 0\nv 9 0 0\nv 2 2 0\nv 0 9 0\n";
  Scene scene = Obj(arrow + "f 4 1 2 3\nf 1 2 3 4\nf 2 3 4 1\n");  // fans would do from two corners only
  EXPECT_EQ(scene.triangles.size(), 6u);
  for (const Triangle& t : scene.triangles)  // corners 0 and 2 are joined: anything else lies outside
    EXPECT_TRUE(std::count(t.begin(), t.end(), 0u) == 1 && std::count(t.begin(), t.end(), 2u) == 1);
  // A frame: the hole is joined to the outline by an edge there and back, so corners occur twice.
  const std::string frame =
      "v 0 0 1\nv 9 0 1\nv 9 9 1\nv 0 9 1\nv 3 3 1\nv 3 6 1\nv 6 6 1\nv 6 3 1\nf 1 2 8\n"
      "f 1 2 3 4 1 5 6 7 8 5\nf 1 2 7\n";
  double area = 0;
  scene = Obj(frame);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 1, 1, 1, 1, 1, 1, 1, 2));
  for (size_t i = 1; i < 9; ++i) {
    const auto [a, b, c] = CornersOf(scene, i);
    area += double(b.x - a.x) * (c.y - a.y) - double(b.y - a.y) * (c.x - a.x);
  }
  EXPECT_EQ(area, 2.0 * (81 - 9));
  EXPECT_TRUE(scene.stats.notes.empty());
  // One that crosses itself.
  scene = Off("OFF\n4 2 0\n0 0 0\n4 0 0\n0 3 0\n5 6 0\n3 0 1 2\n4 0 1 2 3\n");
  EXPECT_EQ(scene.stats.crossed_faces, 1u);
  ASSERT_EQ(scene.stats.notes.size(), 1u);
  EXPECT_THAT(scene.stats.notes[0], AllOf(HasSubstr("1 polygons"), HasSubstr("face 1")));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 1));
}

TEST_F(MeshTest, PolygonsBeforeTheirVertices) {
  // A polygon cannot be cut before its corners are known; nothing overtakes it, and materials stay.
  const std::string vertices = "v 0 0 0\nv 9 0 0\nv 2 2 0\nv 0 9 0\nv 4 0 0\nv 0 3 0\nv 5 6 0\n";
  const std::string faces =
      "f 1 2 3\nusemtl a\nf 4 1 2 3\nf 1 2 4\nusemtl b\nf 1 5 6 7\nf 1 2\nf 2 3 4 1\nf 1 2 3\n";
  const Scene usual = Obj(vertices + faces), early = Obj(faces + vertices);
  EXPECT_THAT(early.triangle_face, ElementsAre(0, 1, 1, 2, 3, 3, 5, 5, 6));
  EXPECT_EQ(early.triangles, usual.triangles);
  EXPECT_EQ(early.triangle_face, usual.triangle_face);
  EXPECT_EQ(early.triangle_material, usual.triangle_material);
  EXPECT_EQ(early.stats.faces, 7u);
  EXPECT_EQ(early.stats.degenerate_triangles, 1u);
  EXPECT_EQ(early.stats.notes, usual.stats.notes);
  EXPECT_THAT(early.stats.notes, ::testing::Contains(HasSubstr("such as face 3")));
  const Scene between = Obj(vertices.substr(0, 24) + faces + vertices.substr(24));
  EXPECT_EQ(between.triangles, usual.triangles);
}

TEST_F(MeshTest, Materials) {
  files_.Write("some materials.mtl",
               "newmtl red\nKd 1 0 0\nKs 0.5 0.25 0\nNs 96\nillum 2\n\nnewmtl mirror\nillum 3\nKd .1 .1 "
               ".1\nKs 0.9 0.8 0.7\n"
               "newmtl glass\nd 0.25\nNi 1.33\nKd 1 1 1\nKe 0 0 2\nmap_Kd missing.png\n");
  Scene scene = Obj(std::string("mtllib some materials.mtl\n") + kSquare +
                    "f 1 2 3\nusemtl mirror\nf 1 2 3\nusemtl glass\nf 1 2 3 4\nusemtl nowhere\nf 1 3 "
                    "4\nusemtl red\nf 2 3 4\n");
  ASSERT_EQ(scene.triangles.size(), 6u);
  auto material = [&](uint32_t i) { return scene.materials[scene.MaterialOf(i)]; };
  EXPECT_EQ(material(0).name, "default");
  EXPECT_EQ(material(1).name, "mirror");
  EXPECT_EQ(material(1).reflect, (Vec3f{0.9f, 0.8f, 0.7f}));
  EXPECT_EQ(material(2).transmit, (Vec3f{0.75f, 0.75f, 0.75f}));
  EXPECT_EQ(material(3).ior, 1.33f);
  EXPECT_EQ(material(3).diffuse, (Vec3f{0.25f, 0.25f, 0.25f}));
  EXPECT_EQ(material(3).emission, (Vec3f{0, 0, 2}));
  EXPECT_TRUE(material(3).thin);
  EXPECT_EQ(material(4).name, "nowhere");
  EXPECT_EQ(material(4).diffuse, Material().diffuse);
  EXPECT_EQ(material(5).diffuse, (Vec3f{1, 0, 0}));
  EXPECT_EQ(material(5).specular, (Vec3f{0.5f, 0.25f, 0}));
  EXPECT_EQ(material(5).shininess, 96);
  EXPECT_EQ(material(5).reflect, (Vec3f{0, 0, 0}));
}

TEST_F(MeshTest, IlluminationModels) {
  std::string mtl, obj = std::string("mtllib m.mtl\n") + kSquare;
  for (int illum = 0; illum <= 10; ++illum) {
    const std::string number = std::to_string(illum);
    mtl += "newmtl clear" + number + "\nKd 0.5 0.5 0.5\nKs 0.25 0.25 0.25\nd 0.5\nNi 1.25\nillum " + number +
           "\nnewmtl solid" + number + "\nillum " + number + "\nKs 0.25 0.25 0.25\n";
    obj += "usemtl clear" + number + "\nf 1 2 3\nusemtl solid" + number + "\nf 1 2 3\n";
  }
  files_.Write("m.mtl", mtl);
  const Scene scene = Obj(obj);
  for (uint32_t illum = 0; illum <= 10; ++illum) {
    SCOPED_TRACE(illum);
    const Material& clear = scene.materials[scene.MaterialOf(2 * illum)];
    const Material& solid = scene.materials[scene.MaterialOf(2 * illum + 1)];
    const bool mirrors = illum >= 3 && illum <= 9, refracts = illum == 6 || illum == 7;
    EXPECT_EQ(solid.specular.x, illum >= 2 ? 0.25f : 0.0f);
    EXPECT_EQ(solid.reflect.x, mirrors ? 0.25f : 0.0f);
    EXPECT_EQ(solid.transmit.x, 0);
    EXPECT_FALSE(solid.thin);
    EXPECT_EQ(solid.diffuse.x, illum == 0 ? 0 : Material().diffuse.x);
    EXPECT_EQ(solid.emission.x, illum == 0 ? Material().diffuse.x : 0);
    EXPECT_EQ(clear.thin, !refracts);
    EXPECT_EQ(clear.fresnel, illum == 5 || illum == 7);
    EXPECT_EQ(clear.ior, 1.25f);
    // Half of it passes, of what is not mirrored; in 7 Fresnel's equations decide about that.
    EXPECT_EQ(clear.reflect.x, mirrors && illum != 7 ? 0.25f : 0.0f);
    EXPECT_EQ(clear.transmit.x, mirrors && illum != 7 ? 0.375f : 0.5f);
    EXPECT_EQ(clear.diffuse.x + clear.emission.x, 0.25f);
  }
}

TEST_F(MeshTest, TransmissionFilterColoursWhatIsRefracted) {
  files_.Write(
      "m.mtl",
      "newmtl glass\nillum 7\nTf 1 0.5 0.25\nd 1\nnewmtl clear\nillum 6\nTr 0.75\nnewmtl veil\nillum 4\n"
      "d -halo 0.5\nTf 1 0 0\nnewmtl maya\nillum 4\nTf 1 1 1\nnewmtl one\nKd 0.25\nNi 0.001\nNs 0\n"
      "newmtl odd\nKd xyz 1 1 1\nNi x\nillum\nKs\nTf spectral a.rfl 1\n");
  std::string obj = std::string("mtllib m.mtl\n") + kSquare;
  for (const char* name : {"glass", "clear", "veil", "maya", "one", "odd"})
    obj += std::string("usemtl ") + name + "\nf 1 2 3\n";
  const Scene scene = Obj(obj);
  const auto material = [&](uint32_t i) { return scene.materials[scene.MaterialOf(i)]; };
  EXPECT_EQ(material(0).transmit, (Vec3f{1, 0.5f, 0.25f}));
  EXPECT_EQ(material(0).diffuse, (Vec3f{1, 1, 1} - material(0).transmit) * Material().diffuse);
  EXPECT_EQ(material(1).transmit, (Vec3f{0.75f, 0.75f, 0.75f}));
  EXPECT_EQ(material(2).transmit, (Vec3f{0.5f, 0.5f, 0.5f})) << "dissolves without colour";
  EXPECT_EQ(material(3).transmit, (Vec3f{0, 0, 0})) << "what is solid in files of some programs";
  EXPECT_EQ(material(4).diffuse, (Vec3f{0.25f, 0.25f, 0.25f}));
  EXPECT_EQ(material(4).ior, 1);
  EXPECT_EQ(material(4).shininess, 1);
  EXPECT_EQ(material(5).diffuse, Material().diffuse) << "what does not parse is passed over";
  EXPECT_EQ(material(5).ior, Material().ior);
}

TEST_F(MeshTest, Textures) {
  std::filesystem::create_directory(files_.path() / "look");
  files_.Write("look/my wood.png", "\x89PNG not decoded");
  files_.Write("look/leaf.TGA", "no mark");
  files_.Write("look/m.mtl",
               "newmtl wood\nKd 1 1 1\nmap_Kd -clamp on -s 2 2 1 -o 0 0 0 my wood.png\n"
               "newmtl again\nmap_Kd -clamp on .\\my wood.png\nmap_d leaf.TGA\nbump leaf.TGA\n"
               "newmtl lamp\nKe 4 4 4\nmap_Ke leaf.TGA\n"
               "newmtl lost\nKd 0.5 0.5 0.5\nmap_Kd none.png\nKe 1 1 1\nmap_Ke none.png\n"
               "newmtl plain\n");
  const std::string text =
      std::string("mtllib look/m.mtl\n") + kSquare + "vt 0 0\nvt 1 0.25 # a comment\nvt 0.5\nvt 3 1 0\n";
  const Scene scene = Obj(text +
                          "usemtl wood\nf 1/1 2/2 3/3 4/4\nusemtl plain\nf 1/4 2/4 3/4\n"
                          "usemtl lamp\nf 1/-4 2/-3 3/-1\nusemtl lost\nf 1/2 2/2 3/2\n");
  ASSERT_EQ(scene.textures.size(), 2u);
  EXPECT_EQ(scene.textures[0].name, "my wood.png");
  EXPECT_EQ(scene.textures[0].mime_type, "image/png");
  EXPECT_EQ(scene.textures[0].wrap_u, TextureWrap::kClampToEdge);
  EXPECT_EQ(*scene.textures[0].bytes, "\x89PNG not decoded");
  EXPECT_EQ(scene.textures[1].mime_type, "image/x-tga");
  EXPECT_EQ(scene.textures[1].wrap_u, TextureWrap::kRepeat);
  const auto material = [&](uint32_t i) { return scene.materials[scene.MaterialOf(i)]; };
  EXPECT_EQ(material(0).base_color_texture, 0);
  EXPECT_EQ(material(2).base_color_texture, -1);
  EXPECT_EQ(material(3).emission_texture, 1);
  EXPECT_EQ(material(3).emission, (Vec3f{4, 4, 4}));
  EXPECT_EQ(material(4).base_color_texture, -1);
  EXPECT_EQ(material(4).diffuse, (Vec3f{0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(material(4).emission, (Vec3f{0, 0, 0})) << "all of it would glow";
  EXPECT_THAT(
      scene.stats.notes,
      ElementsAre("m.mtl: textures not applied: bump, map_d", "m.mtl: options of textures not applied: -s",
                  AllOf(HasSubstr("a texture is not used"), HasSubstr("none.png: no such file"))));
  // v points down. Corners 1 and 2 agree with what is there; corner 3 has other coordinates for the lamp,
  // and untextured ones stay with the first.
  ASSERT_EQ(scene.uvs.size(), scene.positions.size());
  const auto uv = [&](size_t i, size_t k) { return scene.uvs[scene.triangles[i][k]]; };
  EXPECT_EQ(uv(0, 0), (Vec2f{0, 1}));
  EXPECT_EQ(uv(0, 1), (Vec2f{1, 0.75f}));
  EXPECT_EQ(uv(0, 2), (Vec2f{0.5f, 1}));
  EXPECT_EQ(uv(1, 2), (Vec2f{3, 0}));
  EXPECT_EQ(scene.triangles[3][0], scene.triangles[0][0]);
  EXPECT_EQ(uv(3, 2), (Vec2f{3, 0}));
  EXPECT_EQ(scene.positions[scene.triangles[3][2]], (Vec3f{1, 1, 0}));
  EXPECT_EQ(scene.triangles[2], scene.triangles[4]) << "neither has coordinates";
  EXPECT_TRUE(scene.normals.empty());
  // 4 of the square, 1 for the lamp, 3 without coordinates.
  EXPECT_EQ(scene.positions.size(), 8u);

  const Scene shared = Obj(text + "usemtl wood\nf 1/1 2/2 3/3\nusemtl again\nf 1/1 2/2 3/3\n");
  EXPECT_EQ(shared.textures.size(), 2u) << "named otherwise";
  EXPECT_EQ(shared.positions.size(), 4u);
}

TEST_F(MeshTest, CoordinatesOnlyWhereATextureWantsThem) {
  files_.Write("p.png", "\x89PNG");
  files_.Write("m.mtl", "newmtl a\nmap_Kd p.png\nnewmtl b\n");
  const std::string text = std::string("mtllib m.mtl\n") + kSquare + "vt 0 0\nvt x 0\n";
  const Scene plain = Obj(text + "usemtl b\nf 1/1 2/1 3/1\nf 1/2 3/2 4/9\n");
  EXPECT_TRUE(plain.uvs.empty());
  EXPECT_TRUE(plain.stats.notes.empty());
  EXPECT_EQ(plain.hash(), Obj(std::string(kSquare) + "f 1 2 3\nf 1 3 4\n").hash());
  const Scene bad = Obj(text + "usemtl a\nf 1/1 2/2 3/3\nf 1 2 4\n");
  EXPECT_THAT(bad.stats.notes,
              ElementsAre("1 corners of triangles refer to texture coordinates or normals that are not there",
                          "2 triangles have a texture but no coordinates for it",
                          "1 texture coordinates are not finite and count as 0"));
  const Scene bare = Obj(text + "usemtl a\nf 1 2 4\n");
  EXPECT_TRUE(bare.uvs.empty());
  EXPECT_THAT(bare.stats.notes, ElementsAre("1 triangles have a texture but no coordinates for it"));
}

TEST_F(MeshTest, NormalsOnlyWhereTheyDifferFromTheTriangles) {
  const std::string text =
      std::string(kSquare) + "vn 0 0 1\nvn 0.6 0 0.8\nvn 0 0 -2\nvn 0.005 0 1\nvn nan 0 1\n";
  const Scene flat = Obj(text + "f 1//1 2//1 3//1 4//1\nf 1//3 2//3 3//3\nf 1//4 2//4 4//4\n");
  EXPECT_TRUE(flat.normals.empty());
  EXPECT_EQ(flat.positions.size(), 4u);
  // One vertex with the triangle's normal, one with another; a leaning triangle.
  const Scene smooth = Obj(text + "f 1//1 2//2 3//2\nf 1//2 2//2 3//2\nf 1//1 2//1 3//1\n");
  const auto normal = [&](size_t i, size_t k) { return smooth.normals.at(smooth.triangles[i][k]); };
  EXPECT_EQ(normal(0, 0), (Vec3f{0, 0, 1}));
  EXPECT_EQ(normal(0, 1), (Vec3f{0.6f, 0, 0.8f}));
  EXPECT_EQ(normal(1, 0), (Vec3f{0.6f, 0, 0.8f}));
  EXPECT_EQ(smooth.triangles[1][1], smooth.triangles[0][1]);
  for (size_t k = 0; k < 3; ++k) EXPECT_EQ(normal(2, k), (Vec3f{0, 0, 0}));
  EXPECT_EQ(smooth.positions.size(), 4u + 1 + 3);
  const Scene bad = Obj(text + "f 1//5 2//1 3//1\nf 1//7 2//2 3//2\n");
  EXPECT_THAT(bad.stats.notes,
              ElementsAre("1 corners of triangles refer to texture coordinates or normals that are not there",
                          "1 shading normals are not finite and count as 0"));
}

TEST_F(MeshTest, LooksStayWithTheirCornersInAnyPolygon) {
  files_.Write("p.png", "\x89PNG");
  files_.Write("m.mtl", "newmtl a\nmap_Kd p.png\n");
  // Texture coordinates are positions / 9, so that any mistake shows. A frame, in which corners occur twice;
  // a corner given twice in a row, a face of two corners, and one left out.
  std::string text = "mtllib m.mtl\n";
  const int at[8][2] = {{0, 0}, {9, 0}, {9, 9}, {0, 9}, {3, 3}, {3, 6}, {6, 6}, {6, 3}};
  for (const auto& [x, y] : at) {
    text += "v " + std::to_string(x) + " " + std::to_string(y) + " 0\n";
    text += "vt " + std::to_string(x / 9.0) + " " + std::to_string(y / 9.0) + "\n";
  }
  text +=
      "v nan 0 0\nusemtl a\nf 3/3 4/4 1/1\nf 1/1 2/2 3/3 4/4 1/1 5/5 6/6 7/7 8/8 5/5\nf 1/1 2/2\n"
      "f 9/1 1/1 2/2\nf 5/5 5/1 6/6 7/7\nf 99/1 1/1 2/2\nf 8/8 7/7 6/6 5/5\n";
  LoadOptions options;
  options.drop_bad = true;
  const Scene scene = Obj(text, options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 1, 1, 1, 1, 1, 1, 1, 4, 6, 6));
  ASSERT_EQ(scene.uvs.size(), scene.positions.size());
  for (const Triangle& t : scene.triangles)
    for (uint32_t v : t) {
      EXPECT_NEAR(scene.uvs[v].u, scene.positions[v].x / 9, 1e-6);
      EXPECT_NEAR(scene.uvs[v].v, 1 - scene.positions[v].y / 9, 1e-6);
    }
}

TEST_F(MeshTest, ObjErrors) {
  EXPECT_THAT(LoadError((files_.path() / "none.obj").string()), HasSubstr("no such file"));
  std::filesystem::create_directory(files_.path() / "folder.obj");
  EXPECT_THAT(LoadError((files_.path() / "folder.obj").string()), HasSubstr("is a directory"));
  EXPECT_THAT(ObjError(""), HasSubstr("is empty"));
  EXPECT_THAT(ObjError("\n\n# nothing\n"), HasSubstr("no faces"));
  EXPECT_THAT(ObjError(kSquare), HasSubstr("no faces"));
  EXPECT_THAT(ObjError(std::string("\x7f"
                                   "ELF\0\1\2\n\0v\n",
                                   12)),
              HasSubstr("no faces"));
  std::string square = kSquare;
  EXPECT_THAT(ObjError(square + "f 1 2 99\n"),
              AllOf(HasSubstr("line 5"), HasSubstr("vertex 99; allowed are 1 to 4")));
  EXPECT_THAT(ObjError(square + "f 1 2 0\n"), HasSubstr("refers to vertex 0"));
  EXPECT_THAT(ObjError(square + "f 1 2 -5\n"), HasSubstr("refers to vertex -5"));
  EXPECT_THAT(ObjError(square + "f 1 2 99999999999\n"), HasSubstr("refers to vertex 99999999999"));
  EXPECT_THAT(ObjError(square + "f 1 2 9999999999999999999999\n"), HasSubstr("an index such as"));
  EXPECT_THAT(ObjError(square + "f 1 2 x\n"), HasSubstr("corner 'x'"));
  EXPECT_THAT(ObjError(square + "f /1 /2 /3\n"), HasSubstr("corner '/1'"));
  EXPECT_THAT(ObjError(square + "f 1 2 3.5\n"), HasSubstr("corner '3.5'"));
  EXPECT_THAT(ObjError(square + "f\n"), HasSubstr("0 corners"));
  EXPECT_THAT(ObjError(square + "f 1 2 3\nf 1 2"), HasSubstr("2 corners"));
  EXPECT_THAT(ObjError(square + "f 1 2 3\nv 1 2"), HasSubstr("vertex 4 has 2 coordinates"));
  EXPECT_THAT(ObjError("v 0 nan 0\n" + square + "f 1 2 3\n"),
              AllOf(HasSubstr("line 1"), HasSubstr("vertex 0"), HasSubstr("finite")));
  EXPECT_THAT(ObjError(square + "v 0 -INF 0\nf 1 2 3\n"), AllOf(HasSubstr("vertex 4"), HasSubstr("finite")));
  EXPECT_THAT(ObjError(square + "v 0 1e39 0\nf 1 2 3\n"), AllOf(HasSubstr("vertex 4"), HasSubstr("finite")));
  EXPECT_THAT(ObjError(square + "v 0 1e999 0\nf 1 2 3\n"), AllOf(HasSubstr("vertex 4"), HasSubstr("finite")));
  EXPECT_THAT(ObjError(square + "f 1 \\\n2 \\\r\n 3\n\nf 1 2 x\n"), HasSubstr("line 9: face 1"));
  EXPECT_THAT(ObjError(square + "v 0 1,5 0\nf 1 2 3\n"), HasSubstr("'1,5'; a number is needed"));
}

TEST_F(MeshTest, TinyNumbersAreNumbers) {
  Scene scene = Obj(std::string(kSquare) + "v 1e-999 -1e-60 2\nf 1 2 5\n");
  EXPECT_EQ(scene.positions[4].z, 2.0f);
  EXPECT_EQ(scene.positions[4].x, 0.0f);
}

TEST_F(MeshTest, BadTrianglesAreDroppedWhenAsked) {
  LoadOptions options;
  options.drop_bad = true;
  Scene scene =
      Obj("v nan 0 0\n" + std::string(kSquare) + "f 2 3 4\nf 1 2 3\nf 2 3 99\nf 3 4 5\nf 0 0 0\nf 2 4 5\n",
          options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 3, 5));
  EXPECT_EQ(scene.positions[2], (Vec3f{1, 0, 0}));
  EXPECT_EQ(scene.stats.dropped_triangles, 3u);
  scene = Off("OFF\n4 4 0\n0 0 0\ninf 0 1\n1 0 0\n0 1 0\n3 0 2 3\n3 0 1 2\n3 0 2 -7\n3 3 2 0\n", options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 3));
  EXPECT_EQ(scene.stats.dropped_triangles, 2u);
}

TEST_F(MeshTest, OffOfEveryKind) {
  const char* files[] = {
      "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n",
      "OFF 4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3",
      "# first\n\nOFF # kind\n# counts\n4 2\n\n0 0 0\n1 0 0 # x\n1 1 0\n0 1 0\n3 0 1 2\n\n4  0 1 2 3\n",
      "OFF\r\n4 2 0\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n3 0 1 2 255 0 0\r\n4 0 1 2 3 0.5 0.5 0.5 1\r\n",
      "COFF\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 1 2 3 4\n1 1 0 1 2 3 4\n0 1 0 1 2 3 4\n3 0 1 2 9\n4 0 1 2 3\n",
      "NOFF\n4 2 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n4 0 1 2 3\n"};
  for (const char* text : files) {
    Scene scene = Off(text);
    EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 2}, Triangle{0, 2, 3}))
        << text;
    EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 1));
    EXPECT_EQ(scene.positions[2], (Vec3f{1, 1, 0}));
    EXPECT_EQ(scene.stats.faces, 2u);
  }
}

TEST_F(MeshTest, OffErrors) {
  EXPECT_THAT(OffError(""), HasSubstr("is empty"));
  EXPECT_THAT(OffError("ply\n"), HasSubstr("the header is 'ply'"));
  EXPECT_THAT(OffError("4OFF\n1 1 1\n"), HasSubstr("header"));
  EXPECT_THAT(OffError("OFF BINARY\n"), HasSubstr("binary"));
  EXPECT_THAT(OffError("OFF\n"), HasSubstr("ends early"));
  EXPECT_THAT(OffError("OFF\n3 x\n"), HasSubstr("counts"));
  EXPECT_THAT(OffError("OFF\n-3 1 0\n"), HasSubstr("counts"));
  EXPECT_THAT(OffError("OFF\n3 0 0\n0 0 0\n"), HasSubstr("no faces"));
  EXPECT_THAT(OffError("OFF\n4294967295 1 0\n"), HasSubstr("counts"));
  EXPECT_THAT(OffError("OFF\n2000000000 1000000000 0\n0 0 0\n"),
              HasSubstr("ends early: vertex 1 of 2000000000"));
  std::string three = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_THAT(OffError(three), HasSubstr("ends early: face 0 of 1"));
  EXPECT_THAT(OffError(three + "3 0 1"), HasSubstr("2 of its 3 corners"));
  EXPECT_THAT(OffError(three + "4294967295 0 1 2"), HasSubstr("3 of its 4294967295 corners"));
  EXPECT_THAT(OffError(three + "3 0 1 3"),
              HasSubstr("line 6: face 0 refers to vertex 3; allowed are 0 to 2"));
  EXPECT_THAT(OffError(three + "3 0 1 -1"), HasSubstr("refers to vertex -1"));
  EXPECT_THAT(OffError(three + "3 0 1 a"), HasSubstr("corner 'a'"));
  EXPECT_THAT(OffError("OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"),
              AllOf(HasSubstr("vertex 1"), HasSubstr("finite")));
  EXPECT_THAT(OffError("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), HasSubstr("vertex 1 has 2 coordinates"));
}

TEST_F(MeshTest, WhatNothingReadsIsCountedOrKept) {
  const std::string text = std::string(kSquare) + "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n";
  const Scene needed = Obj(text);
  EXPECT_TRUE(needed.uvs.empty());
  EXPECT_TRUE(needed.normals.empty());
  EXPECT_EQ(needed.stats.saved_bytes, 3 * sizeof(Vec2f) + sizeof(Vec3f));
  LoadOptions keep;
  keep.keep_unread = true;
  const Scene all = Obj(text, keep);
  EXPECT_EQ(all.stats.saved_bytes, 0u);
  ASSERT_EQ(all.uvs.size(), all.positions.size());
  ASSERT_EQ(all.normals.size(), all.positions.size());
  EXPECT_EQ(all.uvs[all.triangles[0][1]].u, 1);
  EXPECT_EQ(all.uvs[all.triangles[0][1]].v, 1) << "v points down";
  EXPECT_EQ(all.normals[all.triangles[0][1]], (Vec3f{0, 0, 1}));
  EXPECT_EQ(all.hash(), needed.hash());
}

TEST_F(MeshTest, DamagedFilesLoadOrNameTheFile) {
  files_.Write("p.png", "\x89PNG");
  files_.Write("m.mtl", "newmtl a\nmap_Kd p.png\n");
  std::string obj = "mtllib m.mtl\n" + std::string(kSquare) +
                    "vt 0 0\nvt 1 0\nvn 0 1 1\nvn 1 0 1\nvt 1 1\nusemtl a\nf 1 2 3 4\nf 1/1/1 2/2/2 3/3/3\n"
                    "f -1/-1 -2//-2 -3/1/1\n";
  std::string off =
      "COFF\n4 2 0\n0 0 0 1 1 1\n1 0 0 1 1 1\n0 1 0 1 1 1\n1 1 0 1 1 1\n3 0 1 2 9 9 9\n4 0 1 2 3\n";
  EXPECT_LT(CountRefusedMutations(files_, "m.obj", obj, 2000), 2000);
  EXPECT_LT(CountRefusedMutations(files_, "m.off", off, 2000), 2000);
}

TEST_F(MeshTest, ProgressRisesToOne) {
  std::string text = kSquare;
  for (int i = 0; i < 200000; ++i) text += "f 1 2 3\n";
  std::vector<double> seen;
  LoadOptions options;
  options.progress = [&](double fraction) { seen.push_back(fraction); };
  EXPECT_EQ(Obj(text, options).triangles.size(), 200000u);
  EXPECT_GE(seen.size(), 3u);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.back(), 1.0);
}

TEST(LoadSceneTest, UnknownNamesListWhatIsAllowed) {
  EXPECT_THAT(LoadError("tepot"),
              AllOf(HasSubstr("did you mean teapot?"), HasSubstr("raybench list scenes")));
  EXPECT_THAT(LoadError("sphereflake(dept=3)"), HasSubstr("depth"));
  EXPECT_THAT(LoadError("engine(x=1)"), HasSubstr("no parameters"));
  ScratchDirectory files;
  EXPECT_THAT(LoadError(files.Write("model.3ds", "x")),
              AllOf(HasSubstr("unknown format"), HasSubstr(".obj")));
  EXPECT_THAT(LoadError(files.path().string()), HasSubstr("is a directory"));
}

}  // namespace
}  // namespace raybench
