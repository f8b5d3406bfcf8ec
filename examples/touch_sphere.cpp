// The first touch: a sphere of 30 mm radius in the middle of the workspace, and its force.
//   touch_sphere [NAME@host] [seconds]
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "hapticd/client.h"

using namespace std::chrono_literals;

namespace {

// Quadrilaterals between circles of latitude, two triangles each; counter-clockwise from outside.
std::vector<std::array<float, 3>> sphere(double radius) {
  constexpr int kRows = 24;
  constexpr int kColumns = 48;
  const auto at = [&](int row, int column) -> std::array<float, 3> {
    const double latitude = std::numbers::pi * row / kRows;
    // Seam and poles are equal bit by bit from both sides, so that the mesh is closed.
    const double longitude = 2 * std::numbers::pi * (column % kColumns) / kColumns;
    const double around = row % kRows == 0 ? 0 : radius * std::sin(latitude);
    return {static_cast<float>(around * std::sin(longitude)), static_cast<float>(radius * std::cos(latitude)),
            static_cast<float>(around * std::cos(longitude))};
  };
  std::vector<std::array<float, 3>> corners;
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      if (r > 0) corners.insert(corners.end(), {at(r, c), at(r + 1, c), at(r, c + 1)});
      if (r + 1 < kRows) corners.insert(corners.end(), {at(r, c + 1), at(r + 1, c), at(r + 1, c + 1)});
    }
  }
  return corners;
}

}  // namespace

int main(int argc, char** argv) try {
  hapticd::Client client(argc > 1 ? argv[1] : "Phantom@localhost");
  client.onText([](const hapticd::TextReport& r) { std::printf("server: %s\n", r.text.c_str()); });
  client.resetScene();
  client.setSurface(0, {.stiffness = 0.8F, .staticFriction = 0.3F, .dynamicFriction = 0.2F});
  client.uploadCorners(0, sphere(30));

  const double seconds = argc > 2 ? std::atof(argv[2]) : 10;
  for (int i = 0; i < 10 * seconds; ++i) {
    client.runFor(100ms);
    const auto& now = client.latest();
    const auto& f = now.force.force_N;
    std::printf("%s  force %6.3f %6.3f %6.3f N  depth %.3f mm\n",
                now.touching.touching ? "touching" : "free    ", f[0], f[1], f[2], now.depth.depth_m * 1000);
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "touch_sphere: %s\n", error.what());
  return 1;
}
