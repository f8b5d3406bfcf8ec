// Reads a Wavefront OBJ file, fits it into the workspace, uploads it, and prints what the server reports
// about it.
//   upload_mesh FILE.obj [NAME@host]
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "hapticd/client.h"

using namespace std::chrono_literals;

namespace {

struct Mesh {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

// Vertices and faces only; faces of more corners become fans.
Mesh readObj(const char* path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error(std::string("cannot read ") + path);
  Mesh mesh;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "v") {
      std::array<float, 3> v{};
      words >> v[0] >> v[1] >> v[2];
      mesh.vertices.push_back(v);
    } else if (word == "f") {
      std::vector<std::uint32_t> corners;
      while (words >> word) {
        const long number = std::stol(word);  // "7/1/2" reads 7; -1 is the last vertex so far
        const long vertices = static_cast<long>(mesh.vertices.size());
        corners.push_back(static_cast<std::uint32_t>(number < 0 ? vertices + number : number - 1));
      }
      for (std::size_t i = 2; i < corners.size(); ++i) {
        mesh.triangles.push_back({corners[0], corners[i - 1], corners[i]});
      }
    }
  }
  return mesh;
}

void fit(Mesh& mesh, float largest_mm) {
  if (mesh.vertices.empty()) throw std::runtime_error("the file has no vertices");
  std::array<float, 3> low = mesh.vertices[0];
  std::array<float, 3> high = low;
  for (const auto& v : mesh.vertices) {
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], v[i]);
      high[i] = std::max(high[i], v[i]);
    }
  }
  const float extent = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  for (auto& v : mesh.vertices) {
    for (std::size_t i = 0; i < 3; ++i) v[i] = (v[i] - 0.5F * (low[i] + high[i])) * largest_mm / extent;
  }
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 2) throw std::runtime_error("give an OBJ file");
  Mesh mesh = readObj(argv[1]);
  fit(mesh, 60);
  hapticd::Client client(argc > 2 ? argv[2] : "Phantom@localhost");
  client.onText([](const hapticd::TextReport& r) { std::printf("server: %s\n", r.text.c_str()); });
  client.resetScene();
  client.setSurface(0, {.stiffness = 0.8F});
  client.uploadMesh(0, {mesh.vertices, mesh.triangles}, [](const hapticd::UploadProgress& p) {
    std::printf("\r%3.0f %%", 100.0 * static_cast<double>(p.bytesSent) / static_cast<double>(p.bytesTotal));
    std::fflush(stdout);
  });
  std::printf("\n%zu triangles sent\n", mesh.triangles.size());
  client.runFor(1s);  // the server checks the mesh after it became touchable
} catch (const std::exception& error) {
  std::fprintf(stderr, "upload_mesh: %s\n", error.what());
  return 1;
}
