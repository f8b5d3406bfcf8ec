// Every form of PLY that the format's description allows, and what is none.
#include "mesh_io/ply_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace hapticd::mesh_io {
namespace {

using geometry::Vec3f;
using testing::ElementsAre;
using testing::HasSubstr;

const std::string kVertices = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
const std::string kFaces = "element face 2\nproperty list uchar int vertex_indices\n";
const std::string kTextVertices = "0 0 0\n1 0 0\n0 1 0\n1 1 2\n";

std::string text(const std::string& header, const std::string& data) {
  return "ply\nformat ascii 1.0\n" + header + "end_header\n" + data;
}

// In one byte order or the other.
template <class T>
std::string binary(bool big, std::initializer_list<T> values) {
  std::string out;
  for (const T value : values) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    if (big) std::reverse(bytes.begin(), bytes.end());
    out += bytes;
  }
  return out;
}

void expectTwoFaces(const PolygonMesh& mesh) {
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(1, 1, 2)));
  EXPECT_THAT(mesh.sizes, ElementsAre(3, 4));
  EXPECT_THAT(mesh.corners, ElementsAre(0, 1, 2, 0, 1, 3, 2));
}

std::string errorOf(const std::string& bytes) {
  try {
    parsePly(bytes);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Ply, Text) {
  const std::string data = kTextVertices + "3 0 1 2\n4 0 1 3 2";
  expectTwoFaces(parsePly(text(kVertices + kFaces, data)));
  std::string dos = text(kVertices + "comment of a scanner\nobj_info 2\n" + kFaces, "\n" + data + "\n\n");
  for (std::size_t at = 0; (at = dos.find('\n', at)) != std::string::npos; at += 2) dos.insert(at, "\r");
  expectTwoFaces(parsePly(dos));
}

TEST(Ply, BothByteOrdersAndAllTypes) {
  for (const bool big : {false, true}) {
    const std::string format =
        std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian 1.0\n";
    expectTwoFaces(parsePly(format + kVertices + kFaces + "end_header\n" +
                            binary<float>(big, {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 2}) + '\3' +
                            binary<std::int32_t>(big, {0, 1, 2}) + '\4' +
                            binary<std::int32_t>(big, {0, 1, 3, 2})));
    // Other types, properties and elements, in another order.
    std::string data = binary<double>(big, {7, 7});
    for (const Vec3f& v : {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(1, 1, 2)}) {
      data += '\xFF' + binary<std::int16_t>(big, {static_cast<std::int16_t>(v.z())}) +
              binary<double>(big, {v.x()}) + '\2' + binary<float>(big, {5, 6}) +
              static_cast<char>(static_cast<std::int8_t>(v.y()));
    }
    data += binary<std::uint32_t>(big, {3}) + binary<std::uint16_t>(big, {0, 1, 2, 9});
    data += binary<std::uint32_t>(big, {4}) + binary<std::uint16_t>(big, {0, 1, 3, 2, 9});
    expectTwoFaces(parsePly(
        format +
        "element camera 1\nproperty float64 a\nproperty double b\nelement nothing 5\nelement vertex "
        "4\nproperty "
        "uchar red\nproperty int16 z\nproperty float64 x\nproperty list uint8 float32 weights\nproperty int8 "
        "y\n"
        "element face 2\nproperty list uint32 ushort vertex_index\nproperty uint16 flags\nend_header\n" +
        data));
  }
}

TEST(Ply, DataMayBeginWithTheByteOfALineFeed) {
  const std::string ten = std::string("\n\0\x80\x3f", 4);  // a float
  const PolygonMesh mesh = parsePly(
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n" +
      ten + ten + ten);
  EXPECT_NEAR(mesh.vertices.at(0).x(), 1, 1e-5);
}

TEST(Ply, FacesMayPrecedeVertices) {
  expectTwoFaces(parsePly(text(kFaces + kVertices, "3 0 1 2\n4 0 1 3 2\n" + kTextVertices)));
}

TEST(Ply, StripsAlternateAndBeginAnew) {
  const PolygonMesh mesh =
      parsePly(text(kVertices + "element tristrips 1\nproperty list int int vertex_indices\n",
                    kTextVertices + "9 0 1 2 3 -1 3 2 2 1\n"));
  EXPECT_THAT(mesh.sizes, ElementsAre(3, 3));
  EXPECT_THAT(mesh.corners, ElementsAre(0, 1, 2, 2, 1, 3)) << "what has two equal corners is no triangle";
}

TEST(Ply, ErrorsNameThePlace) {
  const std::string header = kVertices + kFaces;
  EXPECT_THAT(errorOf("OFF\n"), HasSubstr("does not begin with 'ply'"));
  EXPECT_THAT(errorOf("ply\nformat ascii 1.0\n"), HasSubstr("no end"));
  EXPECT_THAT(errorOf("ply\n" + kVertices + "end_header\n"), HasSubstr("no format"));
  EXPECT_THAT(errorOf("ply\nformat utf16 1.0\nend_header\n"), HasSubstr("'utf16'"));
  EXPECT_THAT(errorOf(text("element vertex many\n", "")), HasSubstr("'many' in line 3"));
  EXPECT_THAT(errorOf(text("property float x\n", "")), HasSubstr("precedes"));
  EXPECT_THAT(errorOf(text("element vertex 1\nproperty half x\n", "")), HasSubstr("'half'"));
  EXPECT_THAT(errorOf(text("elements vertex 1\n", "")), HasSubstr("begins with 'elements'"));
  EXPECT_THAT(errorOf(text("element vertex 1\nproperty float x\nproperty float y\n", "0 0\n")),
              HasSubstr("no z"));
  EXPECT_THAT(errorOf(text(kFaces, "3 0 1 2\n")), HasSubstr("no vertices"));
  EXPECT_THAT(errorOf(text(kVertices + "element face 1\nproperty int a\n", kTextVertices + "1\n")),
              HasSubstr("vertex_indices"));
  EXPECT_THAT(errorOf(text(header, kTextVertices + "3 0 1 2\n")), HasSubstr("ends early"));
  EXPECT_THAT(errorOf(text(header, "0 0 0\n1 0\n")), HasSubstr("line 11: values are missing"));
  EXPECT_THAT(errorOf(text(header, "0 0 0\n1 0 0,5\n")), HasSubstr("line 11: '0,5' is no number"));
  EXPECT_THAT(errorOf(text(header, kTextVertices + "3 0 1 4\n")), HasSubstr("corner 4, but there are 4"));
  EXPECT_THAT(errorOf(text(header, kTextVertices + "3 0 1 -1\n")), HasSubstr("corner -1"));
  EXPECT_THAT(errorOf(text(header, kTextVertices + "3 0 1 0.5\n")), HasSubstr("corner 0.5"));
  EXPECT_THAT(errorOf(text(header, kTextVertices + "-3 0 1 2\n")), HasSubstr("length of -3"));
  EXPECT_THAT(errorOf(text(header, kTextVertices + "99 0 1 2\n")), HasSubstr("longer than the data"));
  EXPECT_THAT(
      errorOf(text("element vertex 99999999999\nproperty int x\nproperty int y\nproperty int z\n", "")),
      HasSubstr("reduce it"));
  EXPECT_THAT(
      errorOf("ply\nformat binary_little_endian 1.0\n" + kVertices + "end_header\n" + std::string(47, '\0')),
      HasSubstr("ends early"));
}

TEST(Ply, NumbersThatNoDoubleHoldsAreInfiniteOrZero) {
  const PolygonMesh mesh = parsePly(text(
      "element vertex 1\nproperty double x\nproperty float y\nproperty float z\n", "-1e999 1e-999 +2.5e0\n"));
  EXPECT_THAT(mesh.vertices.at(0).x(), -std::numeric_limits<float>::infinity());
  EXPECT_THAT(mesh.vertices.at(0).y(), 0);
  EXPECT_THAT(mesh.vertices.at(0).z(), 2.5F);
}

}  // namespace
}  // namespace hapticd::mesh_io
