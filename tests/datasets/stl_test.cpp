// STL files.

#include <gmock/gmock.h>

#include <cstring>

#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Triangle = std::array<uint32_t, 3>;
using Facet = std::array<Vec3f, 3>;

std::string RawBytes(const void* p, size_t size) { return std::string(static_cast<const char*>(p), size); }

std::string Binary(const std::vector<Facet>& facets, std::string header = "solid, though binary") {
  header.resize(80, ' ');
  const uint32_t count = uint32_t(facets.size());
  std::string text = header + RawBytes(&count, 4);
  for (const Facet& f : facets) text += std::string(12, '\0') + RawBytes(f.data(), sizeof f) + "ab";
  return text;
}

class StlTest : public ::testing::Test {
 protected:
  Scene Stl(const std::string& text, const LoadOptions& options = {}) {
    return LoadScene(files_.Write("model.stl", text), options);
  }
  std::string Error(const std::string& text) { return LoadError(files_.Write("model.stl", text)); }
  ScratchDirectory files_;
};

const char kFacet[] =
    "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 1 1 0\n endloop\nendfacet\n";

TEST_F(StlTest, EqualCornersAreOneVertex) {
  const Vec3f a{0, 0, 0}, b{1, 0, 0}, c{1, 1, 0}, d{0, 1, 0};
  for (bool is_negative : {false, true}) {
    const float zero = is_negative ? -0.0f : 0.0f;  // equal to 0, so the same vertex
    Scene scene = Stl(Binary({{a, b, c}, {Vec3f{zero, zero, 0}, c, d}}));
    EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
    EXPECT_THAT(scene.positions, ElementsAre(a, b, c, d));
  }
  // The smallest difference there is.
  Scene scene = Stl(Binary({{a, b, c}, {Vec3f{0, 0, 1e-45f}, c, d}}));
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{3, 2, 4}));
}

TEST_F(StlTest, EveryFacetKeepsItsId) {
  const Vec3f a{0, 0, 0}, b{1, 0, 0}, c{1, 1, 0}, d{0, 1, 0}, e{2, 0, 0};
  // Degenerate ones, one four times at an edge, one twice, one turned round.
  Scene scene =
      Stl(Binary({{a, a, b}, {a, b, c}, {a, b, e}, {a, b, d}, {a, b, c}, {b, a, c}, {b, b, b}, {a, c, d}}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(1, 3, 4, 5, 7));
  EXPECT_EQ(scene.stats.faces, 8u);
  EXPECT_EQ(scene.stats.degenerate_triangles, 3u);
}

TEST_F(StlTest, AsciiOfEveryKind) {
  for (const std::string& text : {
           std::string("solid\n") + kFacet + "endsolid\n",
           std::string("solid a name, facet or not\n") + kFacet + "endsolid a name",
           std::string("\n  SOLID x\r\n FACET NORMAL nan nan nan OUTER LOOP VERTEX 0 0 0 VERTEX 1e0 -0 "
                       "0.0\n\nVERTEX\n1 "
                       "+1 0 ENDLOOP ENDFACET ENDSOLID x\n"),
           std::string("solid none\nendsolid none\nsolid two\n") + kFacet + "endsolid two\n",
       }) {
    Scene scene = Stl(text);
    EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2})) << text;
    EXPECT_EQ(scene.positions[2], (Vec3f{1, 1, 0}));
  }
  Scene scene =
      Stl(std::string("solid a\n") + kFacet + "endsolid a\nsolid b\n" + kFacet + kFacet + "endsolid b\n");
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 2));
  EXPECT_EQ(scene.positions.size(), 3u);
}

TEST_F(StlTest, BadFacetsAreDroppedWhenAsked) {
  LoadOptions options;
  options.drop_bad = true;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Vec3f a{0, 0, 0}, b{1, 0, 0}, c{1, 1, 0};
  Scene scene = Stl(Binary({{a, b, Vec3f{0, nan, 0}}, {a, b, c}}), options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(1));
  EXPECT_EQ(scene.stats.dropped_triangles, 1u);
  EXPECT_EQ(scene.stats.faces, 2u);
  std::string text = kFacet;
  text.replace(text.find("1 1 0"), 5, "1 inf 0");
  scene = Stl("solid\n" + text + kFacet + "endsolid\n", options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(1));
}

TEST_F(StlTest, Errors) {
  const std::string facet = kFacet;
  EXPECT_THAT(Error(""), HasSubstr("is empty"));
  EXPECT_THAT(Error("ply\n"), HasSubstr("begins with 'ply'"));
  EXPECT_THAT(Error("solid\nendsolid\n"), HasSubstr("no facets"));
  EXPECT_THAT(Error("solid\n" + facet), HasSubstr("'endsolid' is missing"));
  EXPECT_THAT(Error("solid\n" + facet.substr(0, 60)), AllOf(HasSubstr("ends early"), HasSubstr("facet 0")));
  EXPECT_THAT(Error("solid\n" + facet + "vertex"), HasSubstr("line 9: 'vertex' stands where 'facet'"));
  EXPECT_THAT(Error("solid\n" + facet + "endsolid\nfacet\n"),
              HasSubstr("line 10: 'facet' stands where 'solid'"));
  std::string text = "solid\n" + facet + facet + "endsolid\n";
  const size_t last = text.rfind("1 1 0");
  auto with = [&](const std::string& corner) { return std::string(text).replace(last, 5, corner); };
  EXPECT_THAT(Error(with("1 nan 0")),
              AllOf(HasSubstr("line 13: facet 1"), HasSubstr("'nan'; it must be finite")));
  EXPECT_THAT(Error(with("1 1,5 0")), HasSubstr("'1,5'; a number is needed"));
  EXPECT_THAT(Error(with("1 1 0 vertex 2 2 2")),
              HasSubstr("line 13: facet 1 has 'vertex' where 'endloop' is needed"));
}

TEST_F(StlTest, ErrorsOfBinaryFiles) {
  const Vec3f a{0, 0, 0}, b{1, 0, 0}, c{1, 1, 0};
  const std::string whole = Binary({{a, b, c}, {a, c, b}});
  EXPECT_EQ(Stl(whole).triangles.size(), 2u);
  EXPECT_THAT(Error(whole.substr(0, whole.size() - 1)),
              AllOf(HasSubstr("2 facets, which take 184 bytes"), HasSubstr("has 183")));
  EXPECT_THAT(Error(whole + "x"), HasSubstr("has 185"));
  EXPECT_THAT(Error(Binary({})), HasSubstr("no facets"));
  std::string text = whole;
  text.replace(80, 4, "\xff\xff\xff\xff");
  EXPECT_THAT(Error(text), HasSubstr("4294967295 facets, which take 214748364834 bytes"));
  text = whole;
  text.replace(84 + 50 + 12 + 16, 4, std::string("\0\0\x80\x7f", 4));
  EXPECT_THAT(Error(text), HasSubstr("byte 162: facet 1 has the corner coordinate inf; it must be finite"));
}

TEST_F(StlTest, DamagedFilesLoadOrNameTheFile) {
  const std::string ascii = std::string("solid\n") + kFacet + kFacet + "endsolid\n";
  const std::string binary = Binary({{Vec3f{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}});
  for (const std::string& text : {ascii, binary}) {
    const int refused = CountRefusedMutations(files_, "m.stl", text, 1000);
    EXPECT_GT(refused, 100);
    EXPECT_LT(refused, 1000);
  }
}

}  // namespace
}  // namespace raybench
