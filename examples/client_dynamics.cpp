// Dynamics in the client: the hand pushes a box in thick oil. The client integrates the motion of the box
// from the contacts of every servo tick and streams its pose back. The client also moves a simulated hand;
// with a real device, push the box yourself.
//   client_dynamics [NAME@host] [seconds]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "hapticd/client.h"

using namespace std::chrono_literals;

namespace {

constexpr double kHalf_mm = 20;
constexpr double kMass_kg = 0.2;
constexpr double kDrag_N_s_per_m = 8;

struct Box {
  hapticd::Vec3 position_m{0, 0, 0};
  hapticd::Vec3 velocity_m_per_s{};
  hapticd::Vec3 impulse_N_s{};  // since the last step

  void step(double dt_s) {
    for (std::size_t i = 0; i < 3; ++i) {
      velocity_m_per_s[i] += (impulse_N_s[i] - kDrag_N_s_per_m * velocity_m_per_s[i] * dt_s) / kMass_kg;
      position_m[i] += velocity_m_per_s[i] * dt_s;
    }
    impulse_N_s = {};
  }
};

void uploadBox(hapticd::Client& client) {
  constexpr float h = kHalf_mm;
  const std::vector<std::array<float, 3>> corners{{-h, -h, -h}, {h, -h, -h}, {-h, h, -h}, {h, h, -h},
                                                  {-h, -h, h},  {h, -h, h},  {-h, h, h},  {h, h, h}};
  const std::vector<std::array<std::uint32_t, 3>> faces{{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                                        {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                                        {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  client.batch([&] {
    client.setSurface(0, {.stiffness = 0.6F, .staticFriction = 0.3F, .dynamicFriction = 0.2F});
    client.uploadMesh(0, {corners, faces});
  });
}

}  // namespace

int main(int argc, char** argv) try {
  hapticd::Client client(argc > 1 ? argv[1] : "Phantom@localhost");
  const double seconds = argc > 2 ? std::atof(argv[2]) : 10;
  const auto can = client.waitCapabilities();
  const double tick_s = can ? 1 / can->servoRate_Hz : 0.001;
  const bool lead = can && can->holdHand;
  const auto lead_to = [&](double x_mm) {
    if (lead) client.holdHand({{x_mm, 0, 0}});
  };
  client.resetScene();  // what other clients left would hold the hand
  lead_to(-50);
  client.runFor(500ms);  // otherwise the box could appear around the hand
  uploadBox(client);

  Box box;
  double strongest_N = 0;
  unsigned long ticks = 0;
  std::chrono::nanoseconds last{};
  client.onContacts([&](const hapticd::ContactsReport& r) {
    // The contacts of this report also stand for those of lost reports, for at most a few ticks.
    const double dt_s = std::clamp(std::chrono::duration<double>(r.tickTime - last).count(), 0.0, 5 * tick_s);
    last = r.tickTime;
    for (const hapticd::Contact& c : r.contacts) {
      for (std::size_t i = 0; i < 3; ++i) box.impulse_N_s[i] -= c.force_N[i] * dt_s;
      strongest_N = std::max(strongest_N, std::hypot(c.force_N[0], c.force_N[1], c.force_N[2]));
    }
    ticks += r.contacts.empty() ? 0 : 1;
  });
  client.subscribe(hapticd::Reports::contacts, can ? can->servoRate_Hz : 0);

  constexpr auto kFrame = 4ms;
  const auto start = std::chrono::steady_clock::now();
  const int frames = static_cast<int>(seconds / std::chrono::duration<double>(kFrame).count());
  for (int frame = 0; frame < frames; ++frame) {
    lead_to(-50 + 80.0 * frame / frames);
    box.step(std::chrono::duration<double>(kFrame).count());
    const auto& p = box.position_m;
    client.setTransform(0, hapticd::translation(1000 * p[0], 1000 * p[1], 1000 * p[2]));
    client.flush();
    client.runFor(start + (frame + 1) * kFrame - std::chrono::steady_clock::now());
    if (frame % 125 == 0) std::printf("box at %6.2f %6.2f %6.2f mm\n", 1000 * p[0], 1000 * p[1], 1000 * p[2]);
  }
  const auto& p = box.position_m;
  std::printf("touched in %lu ticks, at most %.2f N; the box moved %.1f mm\n", ticks, strongest_N,
              1000 * std::hypot(p[0], p[1], p[2]));
} catch (const std::exception& error) {
  std::fprintf(stderr, "client_dynamics: %s\n", error.what());
  return 1;
}
