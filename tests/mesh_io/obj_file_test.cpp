// What programs write as OBJ, and what is none.
#include "mesh_io/obj_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

namespace hapticd::mesh_io {
namespace {

using geometry::Vec3f;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kThree = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

std::string objErrorOf(const std::string& bytes) {
  try {
    parseObj(bytes);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "accepted";
}

Vec3f vertexOf(const std::string& numbers) {
  const PolygonMesh mesh = parseObj("v 9 9 9\nv " + numbers + "\nv 8 8 8\n");
  EXPECT_EQ(mesh.vertices.size(), 3U) << numbers;
  return mesh.vertices.at(1);
}

// A vertex that a reader passes over shifts the corners of all faces behind it.
TEST(Obj, NumbersAsProgramsWriteThem) {
  for (const std::string numbers :
       {"0.5 -2 300", ".5 -2. 3e2", "+.5 -2.0 +3.E+02", "0.5 -2 300 1", "0.5 -2 300 0", "0.5 -2 300 0 0",
        "0.5 -2 300 0.1 0.2 0.3", "0.5 -2 300 255 128 0 1", "0,5 -2,0 300,0", "\t.5\t -2 \t3.0E+2 \t",
        "0.5 -2 300 # a # b", "0.5 -2 300\r"})
    EXPECT_EQ(vertexOf(numbers), Vec3f(0.5F, -2, 300)) << numbers;
  EXPECT_EQ(vertexOf("0.1 16777217 1e-50"), Vec3f(0.1F, 16777216, 0)) << "rounded once";
  EXPECT_EQ(vertexOf("1e400 -1e400 0").x(), std::numeric_limits<float>::infinity());
}

TEST(Obj, FacesByNumbersFromEitherEnd) {
  const PolygonMesh mesh =
      parseObj("f 1 2 3 4\n" + kThree +
               "vt 0 0\nvn 0 0 1\nf 1/1 2/1/1 3//1\nv 1 1 2\nf -1/-1 -2//-1 -4/-1/-1\nf 1 2\nf\n");
  EXPECT_THAT(mesh.sizes, ElementsAre(4, 3, 3));
  EXPECT_THAT(mesh.corners, ElementsAre(0, 1, 2, 3, 0, 1, 2, 3, 2, 0));
}

TEST(Obj, OtherLinesAreSkipped) {
  const PolygonMesh mesh = parseObj(
      "# v 1 2 3\nmtllib C:\\part\\\nv 0 0 0\no f 1 2 3\ng v \\\nv 1 0 0\nusemtl m\\\ns off\nv 0 1 0\nl 1 "
      "2\np 1\nvp 0 0\n"
      "cstype bezier\ncurv 0 1 1 2 \\\n 3\nf 1 2 3 # \\\nend\n");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)));
  EXPECT_THAT(mesh.corners, ElementsAre(0, 1, 2));
  EXPECT_THAT(parseObj("").vertices, IsEmpty());
}

TEST(Obj, LinesOfAllSystemsAndContinuedOnes) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    std::string text = "  v 0 0 \\\n0\nv 1 0 0\n\tv 0 1 0\nf 1 \\\n 2 \\\n  3";
    for (std::size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + end.size()))
      text.replace(at, 1, end);
    const PolygonMesh mesh = parseObj(text);
    EXPECT_THAT(mesh.vertices, ElementsAre(Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)));
    EXPECT_THAT(mesh.corners, ElementsAre(0, 1, 2));
    EXPECT_THAT(objErrorOf(text + end + end + "f 1 2 x"), HasSubstr("line 9: ")) << "each counted once";
  }
  EXPECT_THAT(parseObj(kThree + "f 1 2 3 \\").corners, ElementsAre(0, 1, 2)) << "at the end of the file";
}

TEST(Obj, ErrorsNameTheLine) {
  EXPECT_EQ(objErrorOf(kThree + "v 1 2\n"), "line 4: a vertex has 2 coordinates, expected 3");
  EXPECT_EQ(objErrorOf(kThree + "v 1 2 3;\n"), "line 4: '3;' is no number");
  EXPECT_EQ(objErrorOf(kThree + "v 1 2 +-3\n"), "line 4: '+-3' is no number");
  EXPECT_EQ(objErrorOf("f 1 2 4\n" + kThree + "f 1 2 3\n"),
            "line 1: a face has the corner 4, but there are 3 vertices");
  EXPECT_EQ(objErrorOf("f 1 1 1\n"), "line 1: a face has the corner 1, but there are 0 vertices");
  EXPECT_EQ(objErrorOf(kThree + "f 0 1 2\n"), "line 4: a face has the corner 0, but there are 3 vertices");
  EXPECT_EQ(objErrorOf(kThree + "f -4 1 2\n"), "line 4: a face has the corner -4, but there are 3 vertices");
  EXPECT_THAT(objErrorOf(kThree + "f 1 2 4294967296\n"),
              HasSubstr("line 4: a face has the corner 4294967296"));
  for (const std::string corner : {"1.0", "99999999999999999999", "a", "/1", "+1"})
    EXPECT_THAT(objErrorOf(kThree + "f 1 2 " + corner + "\n"), HasSubstr("is no number of a vertex"));
}

}  // namespace
}  // namespace hapticd::mesh_io
