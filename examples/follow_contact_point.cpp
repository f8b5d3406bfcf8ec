// The surface contact point beside the position of the device. A renderer draws the former: the device itself
// is inside the object.
//   follow_contact_point [NAME@host] [seconds]
#include <cstdio>
#include <cstdlib>

#include "hapticd/client.h"

int main(int argc, char** argv) try {
  hapticd::Client client(argc > 1 ? argv[1] : "Phantom@localhost");
  // A floor of two triangles, 10 mm below the middle, seen from above.
  const std::vector<std::array<float, 3>> floor{{-80, -10, -40}, {-80, -10, 40}, {80, -10, 40},
                                                {-80, -10, -40}, {80, -10, 40},  {80, -10, -40}};
  client.resetScene();
  client.setSurface(0, {.stiffness = 0.6F, .staticFriction = 0.4F, .dynamicFriction = 0.3F});
  client.uploadCorners(0, floor);

  client.onContactPoint([&](const hapticd::ContactPointReport& r) {
    if (!client.latest().touching.touching) return;
    const auto device =
        client.latest().pose.find(1);  // sensor 1: the device itself, where a server reports it
    std::printf("surface %7.2f %7.2f %7.2f mm", r.position_m[0] * 1000, r.position_m[1] * 1000,
                r.position_m[2] * 1000);
    if (device != client.latest().pose.end()) {
      const auto& p = device->second.position_m;
      std::printf("   device %7.2f %7.2f %7.2f mm", p[0] * 1000, p[1] * 1000, p[2] * 1000);
    }
    std::printf("\n");
  });
  client.onTouching([touching = false](const hapticd::TouchingReport& r) mutable {
    if (r.touching != touching) std::printf(r.touching ? "contact\n" : "free\n");
    touching = r.touching;
  });
  client.runFor(std::chrono::milliseconds(argc > 2 ? static_cast<int>(1000 * std::atof(argv[2])) : 10000));
} catch (const std::exception& error) {
  std::fprintf(stderr, "follow_contact_point: %s\n", error.what());
  return 1;
}
