// PLY files.

#include <gmock/gmock.h>

#include <bit>
#include <cstring>

#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Triangle = std::array<uint32_t, 3>;

/// A value as a binary file holds it.
template <class T>
std::string Bytes(T value, bool big_endian = false) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

class PlyTest : public ::testing::Test {
 protected:
  Scene Ply(const std::string& text, const LoadOptions& options = {}) {
    return LoadScene(files_.Write("model.ply", text), options);
  }
  std::string Error(const std::string& text) { return LoadError(files_.Write("model.ply", text)); }

  /// A header with 4 vertices of floats and the given faces.
  static std::string Header(const std::string& format, int faces,
                            const std::string& list = "list uchar int vertex_indices") {
    return "ply\nformat " + format +
           " 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n" +
           "element face " + std::to_string(faces) + "\nproperty " + list + "\nend_header\n";
  }
  static constexpr const char* kSquare = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

  ScratchDirectory files_;
};

TEST_F(PlyTest, Ascii) {
  Scene scene = Ply(Header("ascii", 3) + kSquare + "3 0 1 2\n4 0 1 2 3\n3 2 0 1");
  EXPECT_THAT(scene.triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{2, 0, 1}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 1, 2));
  EXPECT_EQ(scene.positions[2], (Vec3f{1, 1, 0}));
  EXPECT_EQ(scene.stats.faces, 3u);
}

TEST_F(PlyTest, OtherElementsAndPropertiesAreSkipped) {
  Scene scene =
      Ply("ply\r\nformat ascii 1.0\r\ncomment x element vertex 9\r\nobj_info y\r\nelement material 2\r\n"
          "property list uchar float colour\r\nproperty int id\r\n"
          "element face 2\r\nproperty uchar flags\r\nproperty list int32 uint8 vertex_index\r\nproperty list "
          "uchar double "
          "uv\r\n"
          "element nothing 5\r\n"
          "element vertex 4\r\nproperty list uchar int tags\r\nproperty double z\r\nproperty short y\r\n"
          "property uchar red\r\nproperty int8 x\r\nend_header\r\n"
          "3 1 2 3 7\r\n0 8\r\n1 3 0 1 2 0\r\n2 3 2 1 3 2 .5 .5\r\n\r\n0 5e-1 0 255 0\r\n2 9 9 0 0 255 "
          "1\r\n0 0 1 255 "
          "1\r\n0 0 1 255 0\r\n");
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}));
  EXPECT_EQ(scene.positions[0], (Vec3f{0, 0, 0.5f}));
  EXPECT_EQ(scene.positions[2], (Vec3f{1, 1, 0}));
}

TEST_F(PlyTest, BinaryOfEveryType) {
  for (bool big : {false, true}) {
    const std::string format = big ? "binary_big_endian" : "binary_little_endian";
    auto check = [&](const Scene& scene) {
      EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3})) << format;
      EXPECT_EQ(scene.positions[1], (Vec3f{1, -2, 3})) << format;
    };
    auto corner = [&]<class T>(T) {
      std::string text;
      for (Vec3f p : {Vec3f{0, 0, 0}, {1, -2, 3}, {0, 5, 0}, {7, 0, 0}})
        for (int k = 0; k < 3; ++k) text += Bytes(T(p[k]), big);
      return text;
    };
    auto faces = [&]<class N, class I>(N n, I) {
      std::string text;
      for (std::array<int, 3> t : {std::array{0, 1, 2}, {2, 1, 3}}) {
        text += Bytes(n, big);
        for (int v : t) text += Bytes(I(v), big);
      }
      return text;
    };
    auto header = [&](const std::string& type, const std::string& list) {
      return "ply\nformat " + format + " 1.0\nelement vertex 4\nproperty " + type + " x\nproperty " + type +
             " y\nproperty " + type + " z\nelement face 2\nproperty list " + list +
             " vertex_indices\nend_header\n";
    };
    check(Ply(header("float", "uchar int") + corner(0.0f) + faces(uint8_t(3), int32_t())));
    check(Ply(header("double", "char uint") + corner(0.0) + faces(int8_t(3), uint32_t())));
    check(Ply(header("int", "short ushort") + corner(int32_t()) + faces(int16_t(3), uint16_t())));
    check(Ply(header("short", "ushort short") + corner(int16_t()) + faces(uint16_t(3), int16_t())));
    check(Ply(header("int8", "int32 uint8") + corner(int8_t()) + faces(int32_t(3), uint8_t())));
    check(Ply(header("float32", "uint32 int8") + corner(0.0f) + faces(uint32_t(3), int8_t())));
  }
}

TEST_F(PlyTest, BinarySkipsWhatItDoesNotNeed) {
  std::string text =
      "ply\r\nformat binary_big_endian 1.0\r\nelement face 1\r\nproperty ushort a\r\nproperty list uchar "
      "short b\r\n"
      "property list uchar uchar vertex_indices\r\nproperty double c\r\nelement other 2\r\nproperty list int "
      "double d\r\n"
      "element vertex 3\r\nproperty uchar red\r\nproperty float x\r\nproperty float y\r\nproperty list uchar "
      "char e\r\n"
      "property float z\r\nend_header\r\n";
  text += Bytes(uint16_t(1), true) + Bytes(uint8_t(2)) + Bytes(uint32_t(7)) + "\3" +
          std::string("\0\1\2", 3) + Bytes(0.0);
  text += Bytes(0) + Bytes(2, true) + Bytes(1.0) + Bytes(2.0);
  for (float x : {0.0f, 1.0f, 2.0f})
    text += "r" + Bytes(x, true) + Bytes(x * x, true) + "\2ab" + Bytes(-x, true);
  Scene scene = Ply(text);
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}));
  EXPECT_EQ(scene.positions[2], (Vec3f{2, 4, -2}));
}

TEST_F(PlyTest, TriangleStrips) {
  Scene scene =
      Ply("ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
          "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
          "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n9 0 1 2 3 -1 2 3 4 -1\n");
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{2, 3, 4}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 2));
}

TEST_F(PlyTest, PolygonsBeforeTheirVertices) {
  const Scene scene =
      Ply("ply\nformat ascii 1.0\nelement face 3\nproperty list uchar int vertex_indices\nelement vertex 4\n"
          "property float x\nproperty float y\nproperty float z\nelement tristrips 1\n"
          "property list int int vertex_indices\nend_header\n"
          "3 0 1 2\n4 3 0 1 2\n3 1 2 0\n0 0 0\n9 0 0\n2 2 0\n0 9 0\n3 2 3 0\n");
  // The arrow's corners 0 and 2 must be joined, which a fan from its first would not do.
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{2, 3, 0}, Triangle{0, 1, 2},
                                           Triangle{1, 2, 0}, Triangle{2, 3, 0}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 1, 2, 3));
}

TEST_F(PlyTest, FacesKeepTheirIdsWhateverTheyAre) {
  std::string text = Header("ascii", 8) + kSquare;
  // Two corners, a repeated corner, a triangle twice and turned round, 300 corners, none.
  text += "2 0 1\n3 0 1 1\n3 0 1 2\n3 0 1 2\n3 1 0 2\n300";
  for (int i = 0; i < 300; ++i) text += i < 4 ? " " + std::to_string(i) : " 3";
  text += "\n0\n3 1 2 3\n";
  Scene scene = Ply(text);
  EXPECT_THAT(scene.triangle_face, ElementsAre(2, 3, 4, 5, 5, 7));
  EXPECT_EQ(scene.stats.faces, 8u);
  EXPECT_EQ(scene.stats.degenerate_triangles, 1u + 1 + 296 + 1);
}

TEST_F(PlyTest, BadTrianglesAreDroppedWhenAsked) {
  LoadOptions options;
  options.drop_bad = true;
  Scene scene = Ply(
      Header("ascii", 4) + "0 0 0\nnan 0 0\n1 1 0\n0 1 0\n3 0 2 3\n3 0 1 2\n3 0 2 -7\n3 3 2 0\n", options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 3));
  EXPECT_EQ(scene.stats.dropped_triangles, 2u);
}

TEST_F(PlyTest, Errors) {
  const std::string ascii = Header("ascii", 1) + kSquare;
  EXPECT_THAT(Error(""), HasSubstr("is empty"));
  EXPECT_THAT(Error("OFF\n"), HasSubstr("line 1: begins with 'OFF'"));
  EXPECT_THAT(Error("ply\n"), HasSubstr("end_header is missing"));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nelement"), HasSubstr("count"));
  EXPECT_THAT(Error("ply\nend_header\n"), HasSubstr("no format"));
  EXPECT_THAT(Error("ply\nformat utf8 1.0\nend_header\n"), AllOf(HasSubstr("line 2"), HasSubstr("'utf8'")));
  EXPECT_THAT(Error("ply\nformat ascii 2.0\nend_header\n"), HasSubstr("version is '2.0'"));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nend_header\n"), HasSubstr("no element vertex"));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n"),
              HasSubstr("needs the properties x, y and z"));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nelement vertex -1\n"),
              AllOf(HasSubstr("line 3"), HasSubstr("'-1'")));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nelement vertex 1\nproperty vec3 p\n"),
              HasSubstr("'vec3' is no type"));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nproperty float x\n"), HasSubstr("before the first element"));
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nhello\n"), HasSubstr("'hello' is no header line"));
  EXPECT_THAT(Error(Header("ascii", 1, "list uchar float vertex_indices")), HasSubstr("list of integers"));
  EXPECT_THAT(Error(Header("ascii", 1, "list float int vertex_indices")), HasSubstr("integer type"));
  EXPECT_THAT(Error(Header("ascii", 1, "int vertex_indices")), HasSubstr("needs the property list"));
  std::string cloud = Header("ascii", 0);
  cloud.erase(cloud.find("element face"), cloud.find("end_header") - cloud.find("element face"));
  EXPECT_THAT(Error(cloud + kSquare), HasSubstr("no element face"));
  EXPECT_THAT(Error(Header("ascii", 0) + kSquare), HasSubstr("no faces"));
  EXPECT_THAT(Error(ascii), HasSubstr("ends early"));
  EXPECT_THAT(Error(ascii + "3 0 1 4\n"),
              HasSubstr("line 14: face 0 refers to vertex 4; allowed are 0 to 3"));
  EXPECT_THAT(Error(ascii + "3 0 1 -1\n"), HasSubstr("refers to vertex -1"));
  EXPECT_THAT(Error(ascii + "3 0 1"), HasSubstr("face 0 ends before its property 'vertex_indices'"));
  EXPECT_THAT(Error(ascii + "3 0 1 x\n"), HasSubstr("corner 'x'"));
  EXPECT_THAT(Error(ascii + "-3 0 1 2\n"), HasSubstr("list length '-3'"));
  EXPECT_THAT(Error(ascii + "3 0 1 2 3\n"), HasSubstr("more values"));
  EXPECT_THAT(Error(ascii + "3 0 1 2\n3 0 1 2\n"), HasSubstr("8 bytes more"));
  EXPECT_THAT(Error(Header("ascii", 1) + "0 0 0\n0 inf 0\n1 0 0\n0 1 0\n3 0 2 3\n"),
              AllOf(HasSubstr("line 11"), HasSubstr("vertex 1"), HasSubstr("finite")));
  EXPECT_THAT(Error(Header("ascii", 1) + "0 0 0\n0 1,5 0\n1 0 0\n0 1 0\n3 0 2 3\n"), HasSubstr("'1,5'"));
}

TEST_F(PlyTest, ErrorsOfBinaryFiles) {
  std::string vertices, face = "\3" + Bytes(0) + Bytes(1) + Bytes(2);
  for (float x : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f})
    vertices += Bytes(x);
  const std::string header = Header("binary_little_endian", 1), whole = header + vertices + face;
  EXPECT_EQ(Ply(whole).triangles.size(), 1u);
  EXPECT_THAT(Error(whole.substr(0, whole.size() - 1)), HasSubstr("face 0 of 1 needs 12 more bytes"));
  EXPECT_THAT(Error(header + vertices), HasSubstr("ends early"));
  EXPECT_THAT(Error(header.substr(0, header.size() - 1)), HasSubstr("0 follow the header"));
  EXPECT_THAT(Error(whole + face), HasSubstr("13 bytes more"));
  std::string text = whole;
  text.replace(header.size() + 16, 4, Bytes(std::numeric_limits<float>::quiet_NaN()));
  EXPECT_THAT(Error(text), HasSubstr("byte " + std::to_string(header.size() + 16) + ": vertex 1 has y"));
  text = whole;
  text.replace(text.size() - 4, 4, Bytes(4));
  EXPECT_THAT(Error(text), HasSubstr("face 0 refers to vertex 4; allowed are 0 to 3"));
  // Claims of gigabytes in a small file.
  for (const char* list : {"list uint int vertex_indices", "list int int vertex_indices"})
    EXPECT_THAT(Error(Header("binary_little_endian", 1, list) + vertices + Bytes(0x7FFFFFFF) + face),
                HasSubstr("needs 8589934588 more bytes"));
  EXPECT_THAT(
      Error(Header("binary_little_endian", 1, "list int int vertex_indices") + vertices + Bytes(-3) + face),
      HasSubstr("list length -3"));
  EXPECT_THAT(Error(Header("binary_little_endian", 1000000000) + vertices + face), HasSubstr("ends early"));
  text = whole;
  text.replace(text.find("vertex 4"), 8, "vertex 2147483647");
  EXPECT_THAT(Error(text), HasSubstr("take 25769803764 bytes"));
}

TEST_F(PlyTest, DamagedFilesLoadOrNameTheFile) {
  const std::string ascii = Header("ascii", 2) + kSquare + "3 0 1 2\n4 0 1 2 3\n";
  std::string binary = Header("binary_big_endian", 1);
  for (float x : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f})
    binary += Bytes(x, true);
  binary += "\4" + Bytes(0, true) + Bytes(1, true) + Bytes(2, true) + Bytes(3, true);
  for (const std::string& text : {ascii, binary}) {
    const int refused = CountRefusedMutations(files_, "m.ply", text, 1000);
    EXPECT_GT(refused, 100);
    EXPECT_LT(refused, 1000);
  }
}

}  // namespace
}  // namespace raybench
