// A MuJoCo scene that the hand feels: the program steps the physics and streams the surfaces near the hand;
// the server renders them at 1 kHz, and its forces move the bodies. It leads a simulated hand along the
// scene's path; with a real device, move it yourself.
//   mujoco SCENE.xml [NAME@host] [seconds] [PICTURE.svg]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "hand_in_scene.h"
#include "hapticd/client.h"

using namespace std::chrono_literals;

int main(int argc, char** argv) try {
  if (argc < 2 || argv[1][0] == '-') {
    std::fprintf(stderr,
                 "usage: mujoco SCENE.xml [NAME@host] [seconds] [PICTURE.svg]\n"
                 "scenes: peg_in_hole.xml, drawer.xml, stacked_blocks.xml\n");
    return 1;
  }
  mujoco_example::HandInScene scene(argv[1]);
  hapticd::Client client(argc > 2 ? argv[2] : "Phantom@localhost");
  const double seconds = argc > 3 ? std::atof(argv[3]) : scene.path().back().time_s;
  const auto can = client.waitCapabilities();
  if (!can || !can->remoteContacts) throw std::runtime_error("the server takes no remote contacts");
  client.onText([](const hapticd::TextReport& r) { std::fprintf(stderr, "server: %s\n", r.text.c_str()); });
  client.resetScene();  // MuJoCo does not know what other clients left
  client.subscribe(hapticd::Reports::hand, can->servoRate_Hz);

  constexpr auto kFrame = 4ms;
  constexpr double kFrame_s = 0.004;
  const auto lead = [&](double time_s) {
    if (!can->holdHand) return;
    const auto place_m = scene.placeAt(time_s);
    client.holdHand({.position = {1000 * place_m[0], 1000 * place_m[1], 1000 * place_m[2]}});
  };
  lead(0);
  client.runFor(500ms);

  double strongest_N = 0;
  double lowest_m = scene.path().front().position_m[1];
  unsigned long touched = 0;
  std::string picture;
  const auto start = std::chrono::steady_clock::now();
  const int frames = static_cast<int>(seconds / kFrame_s);
  const int framesOfPath = static_cast<int>(scene.path().back().time_s / kFrame_s);  // 0: the hand rests
  for (int frame = 0; frame < frames; ++frame) {
    lead(frame * kFrame_s);
    if (framesOfPath > 0 ? frame % framesOfPath == 0 : frame == 0) scene.reset();
    const hapticd::HandReport& hand = client.latest().hand;
    scene.setHand(hand.position_m, hand.velocity_m_per_s);
    scene.setForces(hand.contacts);
    scene.step(kFrame_s);
    client.setRemoteContacts(scene.surfaces());
    client.runFor(start + (frame + 1) * kFrame - std::chrono::steady_clock::now());
    const double force_N = std::hypot(hand.force_N[0], hand.force_N[1], hand.force_N[2]);
    if (!hand.contacts.empty()) {
      ++touched;
      lowest_m = std::min(lowest_m, hand.position_m[1]);
    }
    if (force_N > strongest_N && argc > 4) picture = scene.picture();
    strongest_N = std::max(strongest_N, force_N);
  }
  if (argc > 4) std::ofstream(argv[4]) << picture;
  std::printf("touched in %lu of %d frames, down to %.1f mm, at most %.2f N\n", touched, frames,
              1000 * lowest_m, strongest_N);
} catch (const std::exception& error) {
  std::fprintf(stderr, "mujoco: %s\n", error.what());
  return 1;
}
