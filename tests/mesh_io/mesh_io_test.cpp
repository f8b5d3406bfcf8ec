// Small files written here, in every format, and a real one.
#include "mesh_io/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>

#include "geometry/mesh_check.h"

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

TEST_F(MeshFiles, ErrorsNameTheFileAndTheReason) {
  EXPECT_THAT(errorOf(directory_ / "none.obj"), AllOf(HasSubstr("none.obj"), HasSubstr("No such file")));
  EXPECT_THAT(errorOf(directory_), HasSubstr("not a regular file"));
  EXPECT_THAT(errorOf(write("notes.txt", "hello")),
              AllOf(HasSubstr("notes.txt"), HasSubstr("No suitable reader")));
  EXPECT_THAT(errorOf(write("points.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n")), HasSubstr("points.obj"));
  EXPECT_THAT(errorOf(write("empty.stl", "")), HasSubstr("empty.stl"));
  EXPECT_THAT(errorOf(write("cut.glb", glb(gltfJson("", R"([{"mesh":0}])")).substr(0, 300))),
              HasSubstr("cut.glb"));
  std::string far(80, ' ');
  far += bytes<std::uint32_t>({1'000'000});
  EXPECT_THAT(errorOf(write("short.stl", far)), HasSubstr("short.stl"));
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
