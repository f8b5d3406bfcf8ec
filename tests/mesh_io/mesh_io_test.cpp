// Small files written here, in every format, and a real one.
#include "mesh_io/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <fstream>
#include <map>
#include <random>

#include "geometry/mesh_check.h"
#include "mesh_io/mesh_bytes.h"
#include "reduced.h"

namespace hapticd::mesh_io {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;
using geometry::Vec3f;
using ::testing::AllOf;
using ::testing::HasSubstr;

class MeshFiles : public ::testing::Test {
 protected:
  MeshFiles() {
    directory_ = std::filesystem::temp_directory_path() / ("hapticd_mesh_io_" + std::to_string(::getpid()));
    std::filesystem::create_directories(directory_);
  }
  ~MeshFiles() override { std::filesystem::remove_all(directory_); }

  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::ofstream(directory_ / name, std::ios::binary) << content;
    return directory_ / name;
  }
  std::string errorOf(const std::filesystem::path& file) const {
    try {
      loadMesh(file);
    } catch (const MeshError& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path directory_;
};

template <class T>
std::string bytes(const std::vector<T>& values) {
  std::string out(values.size() * sizeof(T), '\0');
  std::memcpy(out.data(), values.data(), out.size());
  return out;
}

double volume(const TriangleMesh& mesh) {
  double six = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.vertices[t[0]].cast<double>();
    six += a.dot(mesh.vertices[t[1]].cast<double>().cross(mesh.vertices[t[2]].cast<double>()));
  }
  return six / 6;
}

void expectUnitCube(const TriangleMesh& mesh, const Vec3& from = Vec3::Zero()) {
  EXPECT_TRUE((geometry::boundsOf(mesh).min - from).isZero(1e-6));
  EXPECT_EQ(mesh.vertices.size(), 8U);
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_TRUE(geometry::boundsOf(mesh).extents().isApprox(Vec3::Ones(), 1e-6));
  EXPECT_TRUE(geometry::checkMesh(mesh.vertices, mesh.triangles).clean());
}

const std::vector<Vec3f> kCorners = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
const std::vector<std::array<int, 4>> kQuads = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                                {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};

std::vector<std::uint16_t> cubeIndices() {
  std::vector<std::uint16_t> out;
  for (const auto& q : kQuads) {
    for (const int i : {0, 1, 2, 0, 2, 3})
      out.push_back(static_cast<std::uint16_t>(q[static_cast<std::size_t>(i)]));
  }
  return out;
}

TEST_F(MeshFiles, ObjWithQuadsNormalsTwoGroupsAndALine) {
  std::string obj = "o one\n";
  for (const Vec3f& v : kCorners) {
    obj += "v " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
  }
  obj += "vn 0 0 1\nvn 1 0 0\n";
  for (std::size_t i = 0; i < kQuads.size(); ++i) {
    if (i == 3) obj += "o two\nl 1 2\n";
    obj += "f";
    for (const int c : kQuads[i]) obj += " " + std::to_string(c + 1) + "//" + std::to_string(i % 2 + 1);
    obj += "\n";
  }
  const TriangleMesh mesh = loadMesh(write("cube.obj", obj));
  expectUnitCube(mesh);
  EXPECT_NEAR(volume(mesh), 1, 1e-9) << "fronts look outwards";
}

TEST_F(MeshFiles, StlTextAndBinary) {
  const auto indices = cubeIndices();
  std::string text = "solid cube\n";
  std::string binary(80, ' ');
  binary += bytes<std::uint32_t>({12});
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    text += "facet normal 0 0 0\nouter loop\n";
    binary += bytes<float>({0, 0, 0});
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f& v = kCorners[indices[i + k]];
      text += "vertex " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) +
              "\n";
      binary += bytes<float>({v.x(), v.y(), v.z()});
    }
    text += "endloop\nendfacet\n";
    binary += bytes<std::uint16_t>({0});
  }
  for (const TriangleMesh& mesh :
       {loadMesh(write("text.stl", text + "endsolid cube\n")), loadMesh(write("binary.stl", binary))}) {
    expectUnitCube(mesh);
    EXPECT_NEAR(volume(mesh), 1, 1e-9);
  }
}

TEST_F(MeshFiles, PlyTextAndBinary) {
  const std::string counts =
      "element vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement face 6\n"
      "property list uchar int vertex_indices\nend_header\n";
  std::string text = "ply\nformat ascii 1.0\n" + counts;
  std::string binary = "ply\nformat binary_little_endian 1.0\n" + counts;
  for (const Vec3f& v : kCorners) {
    text += std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
    binary += bytes<float>({v.x(), v.y(), v.z()});
  }
  for (const auto& q : kQuads) {
    text += "4";
    binary += bytes<std::uint8_t>({4});
    for (const int i : q) {
      text += " " + std::to_string(i);
      binary += bytes<std::int32_t>({i});
    }
    text += "\n";
  }
  for (const TriangleMesh& mesh :
       {loadMesh(write("text.ply", text)), loadMesh(write("binary.ply", binary))}) {
    expectUnitCube(mesh);
    EXPECT_NEAR(volume(mesh), 1, 1e-9);
  }
}

std::string gltfJson(const std::string& buffer, const std::string& nodes) {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":)" + nodes +
         R"(,"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
{"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":96},{"buffer":0,"byteOffset":96,"byteLength":72}],
"buffers":[{)" +
         buffer + R"("byteLength":168}]})";
}

std::string gltfData() {
  std::vector<float> positions;
  for (const Vec3f& v : kCorners) positions.insert(positions.end(), {v.x(), v.y(), v.z()});
  return bytes(positions) + bytes(cubeIndices());
}

std::string glb(std::string json) {
  while (json.size() % 4 != 0) json += ' ';
  const std::string data = gltfData();
  const auto size = [](const std::string& s) { return static_cast<std::uint32_t>(s.size()); };
  return "glTF" + bytes<std::uint32_t>({2, 12 + 8 + size(json) + 8 + size(data), size(json), 0x4E4F534A}) +
         json + bytes<std::uint32_t>({size(data), 0x004E4942}) + data;
}

TEST_F(MeshFiles, GltfWithItsBinaryBesideIt) {
  write("cube.bin", gltfData());
  const TriangleMesh mesh = loadMesh(
      write("cube.gltf", gltfJson(R"("uri":"cube.bin",)", R"([{"mesh":0,"translation":[10,0,0]}])")));
  expectUnitCube(mesh, Vec3(10, 0, 0));
}

TEST_F(MeshFiles, GlbNodesPlaceAndMirrorTheirMeshes) {
  const TriangleMesh two =
      loadMesh(write("two.glb", glb(gltfJson("", R"([{"children":[1,2],"scale":[2,2,2]},{"mesh":0},
                                      {"mesh":0,"translation":[5,0,0],"scale":[-1,1,1]}])"))));
  EXPECT_EQ(two.vertices.size(), 16U);
  EXPECT_EQ(two.triangles.size(), 24U);
  EXPECT_TRUE(geometry::boundsOf(two).max.isApprox(Vec3(10, 2, 2), 1e-6));
  EXPECT_NEAR(volume(two), 16, 1e-5) << "also the mirrored one has its fronts outside";
}

std::string cubeObj() {
  std::string obj;
  for (const Vec3f& v : kCorners)
    obj += "v " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
  for (const auto& q : kQuads) {
    obj += "f";
    for (const int c : q) obj += " " + std::to_string(c + 1);
    obj += "\n";
  }
  return obj;
}

// The first vertex, which a reader that skips the line would miss.
TEST_F(MeshFiles, AByteOrderMarkBeforeTheText) {
  expectUnitCube(loadMesh(write("mark.obj", "\xEF\xBB\xBF" + cubeObj())));
}

TEST_F(MeshFiles, BytesAfterTheLastTriangleOfABinaryStl) {
  std::string binary(80, ' ');
  binary += bytes<std::uint32_t>({1}) + bytes<float>({0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0}) +
            bytes<std::uint16_t>({0});
  EXPECT_EQ(loadMesh(write("padded.stl", binary + std::string(7, '\0'))).triangles.size(), 1U);
}

TEST_F(MeshFiles, ObjWithIndentedLinesCommentsAndContinuedOnes) {
  std::string obj = cubeObj();
  for (std::size_t at = obj.find("\nf"); at != std::string::npos; at = obj.find("\nf", at + 3))
    obj.replace(at, 2, " # 1 2\n \tf");
  const std::size_t last = obj.rfind(' ');
  obj.insert(last, " \\\r\n  ");
  expectUnitCube(loadMesh(write("indented.obj", "  # part\n   " + obj)));
}

TEST_F(MeshFiles, ObjWhoseCommentEndsInABackslash) {
  std::string obj = cubeObj();
  for (std::size_t at = obj.find("\nf"); at != std::string::npos; at = obj.find("\nf", at + 3))
    obj.replace(at, 2, " # base \\\n# 1 \\\n  f");
  expectUnitCube(loadMesh(write("backslash.obj", obj)));
}

TEST_F(MeshFiles, StlInUpperCase) {
  EXPECT_EQ(loadMesh(write("upper.stl",
                           "SOLID PART OF A MACHINE\nFACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 0 0 0\n"
                           "VERTEX 1.0E+00 0 0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\nENDSOLID\n"))
                .triangles.size(),
            1U);
}

// As CAD programs write them for parts that are hidden.
TEST_F(MeshFiles, StlWithEmptySolids) {
  EXPECT_EQ(
      loadMesh(write("parts.stl",
                     "solid a\nendsolid a\nsolid b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"
                     "vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid b\nsolid c\nendsolid c\n"))
          .triangles.size(),
      1U);
}

TEST_F(MeshFiles, AGltfThatRequiresUnknownMeshesIsRefused) {
  const auto requiring = [](std::string json, const std::string& names) {
    return json.insert(json.find('{') + 1, R"("extensionsRequired" : [ )" + names + " ],");
  };
  const std::string json = gltfJson("", R"([{"mesh":0}])");
  EXPECT_THAT(errorOf(write("whole_numbers.glb",
                            glb(requiring(json, R"("KHR_texture_basisu", "KHR_mesh_quantization")")))),
              HasSubstr("KHR_mesh_quantization"));
  write("cube.bin", gltfData());
  EXPECT_THAT(errorOf(write("packed.gltf", requiring(gltfJson(R"("uri":"cube.bin",)", R"([{"mesh":0}])"),
                                                     R"("EXT_meshopt_compression")"))),
              HasSubstr("EXT_meshopt_compression"));
  expectUnitCube(loadMesh(write("textures.glb", glb(requiring(json, R"("KHR_texture_basisu")")))));
}

// Assimp reads positions from memory that nobody wrote. The shapes that a mesh may blend into are not read.
TEST_F(MeshFiles, AGltfWithSparsePositionsIsRefused) {
  const auto with = [](const std::string& before, const std::string& inserted) {
    std::string json = gltfJson("", R"([{"mesh":0}])");
    return json.insert(json.find(before), inserted);
  };
  const std::string sparse =
      R"("sparse":{"count":1,"indices":{"bufferView":1,"componentType":5123},"values":{"bufferView":0}})";
  EXPECT_THAT(
      errorOf(write("sparse.glb", glb(with(R"("min":[0,0,0])", sparse + ",")))),
      HasSubstr("sparse.glb': its positions are a sparse accessor, which is not supported: save it without"));
  std::string blends =
      with("],\n\"bufferViews\"", R"(,{"componentType":5126,"count":8,"type":"VEC3",)" + sparse + "}");
  blends.insert(blends.find(R"(,"indices")"), R"(,"targets":[{"POSITION":2}])");
  expectUnitCube(loadMesh(write("blends.glb", glb(blends))));
}

TEST_F(MeshFiles, AGltfWhoseBufferHasASpaceInItsName) {
  write("my cube%.bin", gltfData());
  expectUnitCube(loadMesh(write("cube.gltf", gltfJson(R"("uri":"my%20cube%25.bin",)", R"([{"mesh":0}])"))));
  write("raw%20.bin", gltfData());
  expectUnitCube(loadMesh(write("raw.gltf", gltfJson(R"("uri":"raw%20.bin",)", R"([{"mesh":0}])"))));
}

TEST_F(MeshFiles, ErrorsNameTheFileAndTheReason) {
  EXPECT_THAT(errorOf(directory_ / "none.obj"), AllOf(HasSubstr("none.obj"), HasSubstr("No such file")));
  EXPECT_THAT(errorOf(directory_), HasSubstr("not a regular file"));
  EXPECT_THAT(errorOf(write("notes.txt", "hello")),
              AllOf(HasSubstr("notes.txt"), HasSubstr("'.txt' is not supported: convert it to OBJ, STL")));
  EXPECT_THAT(errorOf(write("cube.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")), HasSubstr("'.off'"))
      << "a format of Assimp that the help does not name";
  for (const auto& [name, content] :
       std::map<std::string, std::string>{{"points.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"},
                                          {"empty.obj", ""},
                                          {"empty.stl", ""},
                                          {"solid.stl", "solid x\nendsolid x\n"}})
    EXPECT_THAT(errorOf(write(name, content)), HasSubstr(name + "': it holds no triangles"));
  for (const std::string format : {"stl", "gltf", "glb"})
    EXPECT_THAT(errorOf(write("text." + format, "a text of another kind, as in any letter")),
                HasSubstr("text." + format + "': it is not a ." + format + " file"));
  EXPECT_THAT(errorOf(write("cut.glb", glb(gltfJson("", R"([{"mesh":0}])")).substr(0, 300))),
              HasSubstr("cut.glb"));
  std::string first = glb(gltfJson("", R"([{"mesh":0}])"));
  first[4] = 1;
  EXPECT_THAT(errorOf(write("first.glb", first)), HasSubstr("it is glTF 1: save it as glTF 2"));
  for (const std::string mark : {"\xFE\xFF", "\xFF\xFE"}) {
    std::string wide = mark;
    for (const char c : cubeObj()) wide += mark[0] == '\xFE' ? std::string{'\0', c} : std::string{c, '\0'};
    EXPECT_THAT(errorOf(write("wide.obj", wide)), HasSubstr("it is a text in UTF-16: save it in UTF-8"));
  }
  std::string far(80, ' ');
  far += bytes<std::uint32_t>({1'000'000});
  EXPECT_THAT(errorOf(write("short.stl", far)), HasSubstr("short.stl"));
}

// The bytes of a mesh with these vertices and triangles.
std::vector<std::byte> sentBytes(const TriangleMesh& mesh) {
  std::vector<std::byte> sent;
  sendMesh(mesh, [&](std::span<const std::byte> part) { sent.insert(sent.end(), part.begin(), part.end()); });
  return sent;
}

std::string refusalOf(std::span<const std::byte> sent) {
  try {
    receivedMesh(sent);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(MeshBytes, OnlyAWholeMeshOfFiniteNumbersIsAccepted) {
  const TriangleMesh good{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  const std::vector<std::byte> sent = sentBytes(good);
  EXPECT_EQ(refusalOf(sent), "accepted");
  EXPECT_EQ(receivedMesh(sent).vertices, good.vertices);
  EXPECT_EQ(receivedMesh(sent).triangles, good.triangles);
  for (std::size_t size = 0; size < sent.size(); ++size) {
    EXPECT_THAT(refusalOf(std::span(sent).first(size)), HasSubstr("incomplete")) << size;
  }
  std::vector<std::byte> huge = sent;
  huge[7] = std::byte{0x80};  // 2^63 vertices
  EXPECT_THAT(refusalOf(huge), HasSubstr("incomplete"));

  TriangleMesh bad = good;
  bad.triangles.push_back({0, 1, 3});
  EXPECT_EQ(refusalOf(sentBytes(bad)), "triangle 1 has corner 3, but there are 3 vertices");
  bad = good;
  bad.vertices[1].y() = std::numeric_limits<float>::infinity();
  EXPECT_EQ(refusalOf(sentBytes(bad)), "a coordinate of vertex 1 is not finite");
  EXPECT_THAT(refusalOf(sentBytes({good.vertices, {}})), HasSubstr("no triangles"));
}

TEST_F(MeshFiles, AnotherFormatUnderTheNameOfAMeshIsNotRead) {
  EXPECT_THAT(errorOf(write("disguised.ply", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")),
              HasSubstr("disguised.ply"));
}

TEST_F(MeshFiles, APathMayGoUp) {
  std::filesystem::create_directories(directory_ / "inner");
  write("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(loadMesh(directory_ / "inner" / ".." / "one.obj").triangles.size(), 1U);
}

TEST_F(MeshFiles, AGltfReadsNoBufferOfAnotherFolder) {
  std::filesystem::create_directories(directory_ / "inner");
  write("cube.bin", gltfData());
  EXPECT_THAT(errorOf(write("inner/cube.gltf", gltfJson(R"("uri":"../cube.bin",)", R"([{"mesh":0}])"))),
              HasSubstr("cube.gltf"));
}

TEST_F(MeshFiles, CornersThatDoNotExistAreNoMemoryErrors) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  EXPECT_THAT(errorOf(write("far.ply", header + "3 0 1 900000000\n")), HasSubstr("far.ply"));
  EXPECT_THAT(errorOf(write("negative.ply", header + "3 0 1 -2\n")), HasSubstr("negative.ply"));
  std::string data = gltfData();
  data.replace(data.rfind('\x07'), 1, "\x08");  // the last corner of the last triangle
  write("cube.bin", data);
  EXPECT_THAT(errorOf(write("far.gltf", gltfJson(R"("uri":"cube.bin",)", R"([{"mesh":0}])"))),
              HasSubstr("far.gltf': a triangle has a corner that does not exist"));
}

// Loads in a child with small limits.
std::string outcomeOf(const std::filesystem::path& file) {
  try {
    // A network namespace takes longer than reading such a file.
    const TriangleMesh mesh =
        loadMesh(file, {.memory_bytes = 256U << 20U, .time_s = 0.25, .networkNamespace = false});
    for (const Triangle& t : mesh.triangles) {
      for (const std::uint32_t corner : t) {
        if (corner >= mesh.vertices.size()) return "a corner that does not exist";
      }
    }
    for (const Vec3f& v : mesh.vertices) {
      if (!v.allFinite()) return "a vertex that is not finite";
    }
    return "mesh";
  } catch (const MeshError& error) {
    const std::string text = error.what();
    return text.find(file.filename().string()) == std::string::npos ? "no name in: " + text : "error";
  }
}

void mutate(std::string& bytes, std::mt19937& random) {
  static const std::array<std::string, 10> kPieces = {
      "4000000000",      "-1", "1e39", "nan", std::string(4, '\xff'), std::string(4, '\0'),
      "{\"a\":[[[[[[[[", "0",  "\n\n", " "};
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : random() % n; };
  for (std::size_t changes = 1 + below(2); changes > 0; --changes) {
    const std::size_t at = below(bytes.size());
    const std::size_t length = std::min(bytes.size() - at, below(40));
    switch (below(8)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        bytes.erase(at, length);
        break;
      case 2:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 3:
        bytes.replace(at, std::min<std::size_t>(4, bytes.size() - at), kPieces[below(kPieces.size())]);
        break;
      case 4:
        if (const std::size_t digit = bytes.find_first_of("0123456789", at); digit != std::string::npos)
          bytes.replace(digit, 1, kPieces[below(kPieces.size())]);
        break;
      default:
        if (!bytes.empty()) bytes[at] = static_cast<char>(random());
    }
  }
}

TEST_F(MeshFiles, AFileThatTakesForEverIsAnError) {
  // Assimp cuts a polygon into triangles in a time that grows with the square of its corners.
  std::string obj;
  std::string face = "f";
  for (int i = 0; i < 60'000; ++i) {
    obj += "v " + std::to_string(i % 977) + " " + std::to_string(i * 7919 % 991) + " 0\n";
    face += " " + std::to_string(i + 1);
  }
  const std::filesystem::path file = write("polygon.obj", obj + face + "\n");
  try {
    loadMesh(file, {.time_s = 0.3});
    ADD_FAILURE() << "it was read";
  } catch (const MeshError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("polygon.obj"), HasSubstr("takes longer than 0.3 s")));
  }
}

#ifndef HAPTICD_SANITIZED  // sanitizers map more than any limit
TEST_F(MeshFiles, AFileThatTakesAllMemoryIsAnError) {
  constexpr std::uint32_t kTriangles = 10'000'000;
  const std::filesystem::path file =
      write("large.stl", std::string(80, ' ') + bytes<std::uint32_t>({kTriangles}));
  std::filesystem::resize_file(file,
                               84 + std::uintmax_t{50} * kTriangles);  // a hole takes no room on the disk
  try {
    loadMesh(file, {.memory_bytes = 256U << 20U});
    ADD_FAILURE() << "it was read";
  } catch (const MeshError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("large.stl"), HasSubstr("more than 256 MiB of memory")));
  }
}
#endif

TEST_F(MeshFiles, AFileThatOverflowsTheStackIsAnError) {
  EXPECT_THAT(errorOf(write("deep.gltf", "{\"asset\":" + std::string(200'000, '['))), HasSubstr("deep.gltf"));
}

TEST_F(MeshFiles, MutatedFilesAreMeshesOrErrors) {
  write("cube.bin", gltfData());
  const std::string cube = gltfJson(R"("uri":"cube.bin",)", R"([{"mesh":0}])");
  std::string obj = "mtllib cube.mtl\n";
  std::string stl(80, ' ');
  std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 6\nproperty list uchar int vertex_indices\nend_header\n";
  stl += bytes<std::uint32_t>({12});
  const std::string binary_ply =
      "ply\nformat binary_little_endian 1.0" + ply.substr(std::strlen("ply\nformat ascii 1.0"));
  std::string binary = binary_ply;
  for (const Vec3f& v : kCorners) {
    const std::string text =
        std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
    obj += "v " + text;
    ply += text;
    binary += bytes<float>({v.x(), v.y(), v.z()});
  }
  for (const auto& q : kQuads) {
    obj += "f";
    ply += "4";
    binary += bytes<std::uint8_t>({4});
    for (const int i : q) {
      obj += " " + std::to_string(i + 1);
      ply += " " + std::to_string(i);
      binary += bytes<std::int32_t>({i});
    }
    obj += "\n";
    ply += "\n";
    for (const auto& corners : {std::array<std::size_t, 3>{0, 1, 2}, std::array<std::size_t, 3>{0, 2, 3}}) {
      stl += bytes<float>({0, 0, 0});
      for (const std::size_t i : corners) {
        const Vec3f& v = kCorners[static_cast<std::size_t>(q[i])];
        stl += bytes<float>({v.x(), v.y(), v.z()});
      }
      stl += bytes<std::uint16_t>({0});
    }
  }
  const std::vector<std::pair<std::string, std::string>> files = {
      {"a.obj", obj},
      {"b.stl", stl},
      {"c.ply", ply},
      {"d.ply", binary},
      {"e.glb", glb(gltfJson("", R"([{"mesh":0}])"))},
      {"f.gltf", cube}};
  std::mt19937 random(17);
  std::map<std::string, int> outcomes;
  constexpr int kFiles = reduced(240, 60);
  for (int i = 0; i < kFiles; ++i) {
    auto [name, content] = files[static_cast<std::size_t>(i) % files.size()];
    mutate(content, random);
    ++outcomes[outcomeOf(write(std::to_string(i) + name, content))];
  }
  EXPECT_EQ(outcomes.size(), 2U) << ::testing::PrintToString(outcomes);
  EXPECT_GT(outcomes["mesh"], kFiles / 8);
  EXPECT_GT(outcomes["error"], kFiles / 8);
}

TEST(RealMeshes, ClosedScanAndOpenTeapot) {
  const std::filesystem::path meshes = std::filesystem::path(HAPTICD_TESTDATA) / "meshes";
  const TriangleMesh bunny = loadMesh(meshes / "bunny.obj");
  EXPECT_EQ(bunny.vertices.size(), 1839U);
  EXPECT_EQ(bunny.triangles.size(), 3674U);
  EXPECT_TRUE(geometry::checkMesh(bunny.vertices, bunny.triangles).clean());

  const TriangleMesh teapot = loadMesh(meshes / "teapot.obj");
  EXPECT_EQ(teapot.triangles.size(), 992U);
  const geometry::MeshReport report = geometry::checkMesh(teapot.vertices, teapot.triangles);
  EXPECT_EQ(report.openEdges, 64U);
  EXPECT_EQ(report.unwelded, 0U) << "joined while loading";
  EXPECT_EQ(report.degenerate + report.duplicate + report.crowdedEdges + report.flippedEdges, 0U);
}

}  // namespace
}  // namespace hapticd::mesh_io
