// An object that moves while it is touched: a plate that oscillates vertically, 100 poses per second.
//   moving_object [NAME@host] [seconds]
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include "hapticd/client.h"

using namespace std::chrono_literals;

int main(int argc, char** argv) try {
  hapticd::Client client(argc > 1 ? argv[1] : "Phantom@localhost");
  const std::vector<std::array<float, 3>> plate{{-80, 0, -40}, {-80, 0, 40}, {80, 0, 40},
                                                {-80, 0, -40}, {80, 0, 40},  {80, 0, -40}};
  client.resetScene();
  client.setSurface(0, {.stiffness = 0.6F});
  client.uploadCorners(0, plate);

  const double seconds = argc > 2 ? std::atof(argv[2]) : 10;
  const auto start = std::chrono::steady_clock::now();
  for (int frame = 0; frame < 100 * seconds; ++frame) {
    const double t = frame * 0.01;
    const double height_mm = -10 + 15 * std::sin(2 * std::numbers::pi * 0.5 * t);
    client.setTransform(0, hapticd::translation(0, height_mm, 0));
    client.flush();
    client.runFor(start + frame * 10ms + 10ms -
                  std::chrono::steady_clock::now());  // until the next frame is due
    if (frame % 10 == 0) {
      std::printf("plate %6.2f mm  %s  force %.3f N\n", height_mm,
                  client.latest().touching.touching ? "touching" : "free    ",
                  client.latest().force.force_N[1]);
    }
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "moving_object: %s\n", error.what());
  return 1;
}
