// Height fields and module meshes become the same PLY everywhere.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <map>

#include "datasets/models/conversion.h"
#include "datasets/models/fetch.h"
#include "tests/support/datasets.h"
#include "tests/support/files.h"

namespace raybench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Npy(const std::string& header, const std::string& data) {
  const size_t padded = ((header.size() + 10) / 64 + 1) * 64 - 10;
  return fmt::format("\x93NUMPY\x01{}{}{}{:<{}}{}", '\0', char(padded & 255), char(padded >> 8), header,
                     padded, data);
}

std::string Npy(const std::string& type, const std::string& shape, const std::string& data) {
  return Npy(fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", type, shape), data);
}

template <class T>
std::string BigEndian(std::initializer_list<T> values) {
  std::string bytes;
  for (T value : values) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    for (size_t i = sizeof(T); i-- > 0;) bytes += raw[i];
  }
  return bytes;
}

std::string Gtx(double south, double step, int rows, int columns, const std::string& heights) {
  std::string text = BigEndian<double>({south, -180, step, 360.0 / columns});
  text.append(BigEndian<int32_t>({rows, columns})).append(heights);
  return text;
}

/// What InputError says, in one line that names the file.
std::string Error(const std::function<void()>& act) {
  try {
    act();
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    EXPECT_THAT(e.what(), HasSubstr("field"));
    return e.what();
  }
  return {};
}

/// Every edge is used by two triangles, once in each direction.
bool IsClosed(const TriangleMesh& mesh) {
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (count != 1 || back == edges.end()) return false;
  }
  return true;
}

TEST(HeightFieldTest, NpyOfEveryTypeIsRead) {
  ScratchDirectory files;
  const float data[] = {1, -2, 3, 4, 5, 6};
  const std::string floats(reinterpret_cast<const char*>(data), sizeof data);
  const auto read = [&](const std::string& text) { return ReadNpy(files.Write("field.npy", text)); };
  const HeightField field = read(Npy("<f4", "(2, 3)", floats));
  EXPECT_EQ(field.rows, 2u);
  EXPECT_EQ(field.columns, 3u);
  EXPECT_THAT(field.heights, ElementsAre(1, -2, 3, 4, 5, 6));
  EXPECT_THAT(read(Npy(">i2", "(3,2)", BigEndian<int16_t>({1, -2, 300, 4, 5, -32768}))).heights,
              ElementsAre(1, -2, 300, 4, 5, -32768));
  EXPECT_THAT(read(Npy("<i2", "(2, 2)", std::string("\x01\x00\x02\x00\xff\xff\x00\x01", 8))).heights,
              ElementsAre(1, 2, -1, 256));
  EXPECT_THAT(read(Npy(">f8", "(2, 2)", BigEndian<double>({0.5, 1, 2, -3}))).heights,
              ElementsAre(0.5f, 1, 2, -3));
  EXPECT_THAT(read(Npy(">i4", "(2, 2)", BigEndian<int32_t>({70000, 1, 2, -3}))).heights,
              ElementsAre(70000, 1, 2, -3));
}

TEST(HeightFieldTest, BrokenFilesAreRefused) {
  ScratchDirectory files;
  const auto npy = [&](const std::string& text) {
    return Error([&] { ReadNpy(files.Write("field.npy", text)); });
  };
  const std::string four(16, '\0');
  EXPECT_THAT(npy("hello, world"), HasSubstr("is not a .npy file"));
  EXPECT_THAT(npy("\x93NUMPY\x09 1234567"), HasSubstr("version 9"));
  EXPECT_THAT(npy(std::string("\x93NUMPY\x01\x00\xff\xff{}}", 13)), HasSubstr("ends inside its header"));
  EXPECT_THAT(npy(Npy("<f4", "(2, 2)", four.substr(1))),
              HasSubstr("has 15 bytes of heights; 2 x 2 of 4 bytes"));
  EXPECT_THAT(npy(Npy("<f4", "(2, 2)", four + "x")), HasSubstr("has 17 bytes"));
  EXPECT_THAT(npy(Npy("<f4", "(4,)", four)), HasSubstr("has not two dimensions"));
  EXPECT_THAT(npy(Npy("<f4", "(4000000000, 4000000000)", four)), HasSubstr("each side must have 2 to 16384"));
  EXPECT_THAT(npy(Npy("<f4", "(1, 4)", four)), HasSubstr("each side"));
  EXPECT_THAT(npy(Npy("|O", "(2, 2)", four)), HasSubstr("elements of type"));
  EXPECT_THAT(npy(Npy("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 2)}", four)),
              HasSubstr("Fortran"));
  EXPECT_THAT(npy(Npy("{'descr': '<f4', 'shape': (2, 2)}", four)), HasSubstr("has no 'fortran_order'"));
  EXPECT_THAT(npy(Npy(">f4", "(2, 2)", BigEndian<float>({1, 2, INFINITY, 3}))),
              HasSubstr("row 1, column 0 is not finite"));
  const auto gtx = [&](const std::string& text) {
    return Error([&] {
      const std::string path = files.Write("field.gtx", text);
      GlobeMesh(ReadGtx(path), 1, path);
    });
  };
  EXPECT_THAT(gtx("short"), HasSubstr("ends inside its header"));
  EXPECT_THAT(gtx(Gtx(-90, 90, 3, 4, four)), HasSubstr("has 16 bytes of heights; 3 x 4"));
  EXPECT_THAT(gtx(Gtx(-45, 45, 3, 4, four + four + four)), HasSubstr("-90 to 90 and 360 are needed"));
  EXPECT_THAT(gtx(Gtx(-90, 180, 2, 4, four + four)), HasSubstr("3 x 3"));
}

TEST(HeightFieldTest, GridFacesUp) {
  HeightField field;
  field.rows = 3, field.columns = 4;
  for (int i = 0; i < 12; ++i) field.heights.push_back(float(i));
  const TriangleMesh mesh = GridMesh(field, 10, 20, 0.5);
  EXPECT_EQ(mesh.triangles.size(), 12u);
  EXPECT_EQ(mesh.positions.front(), (Vec3f{-15, 0, -20}));
  EXPECT_EQ(mesh.positions.back(), (Vec3f{15, 5.5f, 20}));
  for (const auto& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    EXPECT_GT(Cross(b - a, c - a).y, 0);
  }
}

TEST(HeightFieldTest, GlobeIsClosedAndFacesOutward) {
  ScratchDirectory files;
  std::string heights;
  for (int i = 0; i < 5 * 8; ++i) heights += BigEndian<float>({float(i % 7 - 3) * 1000});
  const std::string path = files.Write("field.gtx", Gtx(-90, 45, 5, 8, heights));
  const TriangleMesh mesh = GlobeMesh(ReadGtx(path), 100, path);
  EXPECT_EQ(mesh.positions.size(), 3 * 8 + 2u);
  EXPECT_EQ(mesh.triangles.size(), 2 * 8 * 3u);
  EXPECT_TRUE(IsClosed(mesh));
  for (const auto& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    EXPECT_GT(Dot(Cross(b - a, c - a), a + b + c), 0);
  }
  // Row 2 is the equator; column 4 of it lies on longitude 0. Its height is (20 % 7 - 3) km, 100 times
  // too high.
  EXPECT_NEAR(mesh.positions[1 + 8 + 4].x, 1 + 3e5 / 6371008.8, 1e-6);
  EXPECT_EQ(mesh.positions.front().x, 0);
  EXPECT_LT(mesh.positions.front().y, -0.9f);
}

TEST(HeightFieldTest, SineAndCosineAreExactToDouble) {
  const double pi = 3.14159265358979323846;
  for (int i = -4000; i <= 4000; ++i) {
    double sine, cosine;
    SinCosDegrees(i * 0.25, sine, cosine);
    // Reduced exactly first, or the rounding of the argument would be seen.
    const double x = std::remainder(i * 0.25, 360) * pi / 180;
    EXPECT_NEAR(sine, std::sin(x), 1e-15) << i;
    EXPECT_NEAR(cosine, std::cos(x), 1e-15) << i;
    EXPECT_NEAR(sine * sine + cosine * cosine, 1, 1e-15);
  }
  double sine, cosine;
  SinCosDegrees(90, sine, cosine);
  EXPECT_EQ(sine, 1);
  EXPECT_EQ(cosine, 0);
}

TEST(HeightFieldTest, BytesAreTheSameEverywhere) {
  // Digests of what this code wrote; a change would make every cached model be fetched again.
  ScratchDirectory files;
  const std::string npy =
      files.Write("field.npy", Npy(">i2", "(3, 3)", BigEndian<int16_t>({1, 2, 3, 4, 50, 6, 7, 8, 9})));
  const std::string ply = (files.path() / "out.ply").string();
  Convert({"grid", {74.3, 92.7}, 2, ""}, npy, ply);
  EXPECT_EQ(Sha256OfFile(ply), "19af8f03346edde5ee7aa1c80727771b98954ab9e2554d904230f57bdf0f8b92");
  std::string heights;
  for (int i = 0; i < 5 * 6; ++i) heights += BigEndian<float>({float(i * i % 11) * 10});
  Convert({"globe", {1, 1}, 10000, ""}, files.Write("field.gtx", Gtx(-90, 45, 5, 6, heights)), ply);
  EXPECT_EQ(Sha256OfFile(ply), "317a455e0137c63fae60091d5bebdbd1f3bb477ed09b225fa6a7102c74b5719d");
  const std::string text = Read(ply);
  EXPECT_THAT(text, HasSubstr("format binary_little_endian 1.0\nelement vertex 20\n"));
  EXPECT_EQ(text.size(), text.find("end_header\n") + 11 + 20 * 12 + 36 * 13);
}

TEST(ModuleMeshTest, ReadsLiteralArraysAndRefusesTheRest) {
  ScratchDirectory files;
  const auto read = [&](const std::string& text) { return ReadModuleMesh(files.Write("field.js", text)); };
  const TriangleMesh mesh =
      read("exports.positions=[[0,0,0],[1,0,0],[0,1.5,-2e1]]\nexports.cells=[[0,1,2],[2,1,0]]\nexports.x=1");
  EXPECT_EQ(mesh.positions.size(), 3u);
  EXPECT_EQ(mesh.positions[2], (Vec3f{0, 1.5f, -20}));
  EXPECT_THAT(mesh.triangles,
              ElementsAre(std::array<uint32_t, 3>{0, 1, 2}, std::array<uint32_t, 3>{2, 1, 0}));
  const auto error = [&](const std::string& text) { return Error([&] { read(text); }); };
  EXPECT_THAT(error("exports.x=[[1,2,3]]"), HasSubstr("no array of arrays 'positions'"));
  EXPECT_THAT(error("exports.positions=make()"), HasSubstr("no array of arrays 'positions'"));
  EXPECT_THAT(error("exports.positions=[[a,b,c]]"), HasSubstr("not an array of literal numbers"));
  EXPECT_THAT(error("exports.positions=[[1,2]]"), HasSubstr("three numbers each"));
  EXPECT_THAT(error("exports.positions=[[0,0,0]];exports.cells=[[0,0,1]]"),
              HasSubstr("cell 0 refers to position 1; allowed are 0 to 0"));
}

}  // namespace
}  // namespace raybench
