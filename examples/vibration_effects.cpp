// Forces that belong to no object: one second of each effect, one after the other.
//   vibration_effects [NAME@host] [seconds for each]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "hapticd/client.h"

int main(int argc, char** argv) try {
  hapticd::Client client(argc > 1 ? argv[1] : "Phantom@localhost");
  const auto each = std::chrono::milliseconds(argc > 2 ? static_cast<int>(1000 * std::atof(argv[2])) : 1000);
  double strongest_N = 0;
  client.onForce([&](const hapticd::ForceReport& r) {
    strongest_N = std::max(strongest_N, std::hypot(r.force_N[0], r.force_N[1], r.force_N[2]));
  });
  client.onText([](const hapticd::TextReport& r) { std::printf("server: %s\n", r.text.c_str()); });

  using hapticd::Effect;
  const std::pair<const char*, Effect> effects[] = {
      {"a push upwards", Effect::constant({0, 1, 0}, 1.0)},
      {"a pull to the middle", Effect::spring({0, 0, 0}, 0.05, 1.5)},
      {"something viscous", Effect::viscous(0.005, 1.0)},
      {"dry friction", Effect::friction(0.5, 0.8)},
      {"a vibration of 100 Hz", Effect::motorVibration(100, 0.5)},
      {"one that is felt on contact only", Effect::contactVibration(300, 0.5)},
  };
  int index = 0;
  for (const auto& [what, effect] : effects) {
    client.setEffect(index, effect);
    client.startEffect(index);
    strongest_N = 0;
    client.runFor(each);
    client.stopEffect(index++);
    std::printf("%-34s %.2f N\n", what, strongest_N);
  }
  client.flushAll();
} catch (const std::exception& error) {
  std::fprintf(stderr, "vibration_effects: %s\n", error.what());
  return 1;
}
