// One client builds the scene and two watch it, all in one thread. Objects stay when their client
// disconnects; its effects end.
//   several_clients [NAME@host] [seconds]
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "hapticd/client.h"

using namespace std::chrono_literals;

int main(int argc, char** argv) try {
  const char* name = argc > 1 ? argv[1] : "Phantom@localhost";
  const double seconds = argc > 2 ? std::atof(argv[2]) : 5;

  hapticd::Client first(name);
  hapticd::Client second(name);
  int forces[2] = {0, 0};
  first.onForce([&](const hapticd::ForceReport&) { ++forces[0]; });
  second.onForce([&](const hapticd::ForceReport&) { ++forces[1]; });

  std::optional<hapticd::Client> builder(name);
  const std::vector<std::array<float, 3>> floor{{-80, -10, -40}, {-80, -10, 40}, {80, -10, 40},
                                                {-80, -10, -40}, {80, -10, 40},  {80, -10, -40}};
  builder->resetScene();
  builder->setSurface(0, {.stiffness = 0.7F});
  builder->uploadCorners(0, floor);
  builder->setEffect(0, hapticd::Effect::constant({0, -1, 0}, 0.5));
  builder->startEffect(0);
  builder->flushAll();

  // The clients poll in turn; reports for the other one wait in its socket.
  const auto watch = [&](double s) {
    for (int turn = 0; turn < 50 * s; ++turn) {
      first.runFor(10ms);
      second.runFor(10ms);
    }
    std::printf("force reports: %d and %d, force now %.3f N and %.3f N\n", forces[0], forces[1],
                first.latest().force.force_N[1], second.latest().force.force_N[1]);
  };
  watch(seconds / 2);
  builder.reset();
  std::printf("the builder has left: its push ends, its floor stays\n");
  watch(seconds / 2);
  return forces[0] > 0 && forces[1] > 0 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "several_clients: %s\n", error.what());
  return 1;
}
