// Work on fixed inputs, to have its instructions counted: hapticd_counted WHAT ROUNDS. Two runs with
// different ROUNDS give what one round takes without the set-up. See tests/bench/instructions_test.sh.
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "base/time.h"
#include "bench/scenes.h"
#include "realtime/render/renderer.h"
#include "wire/codec.h"
#include "wire/cookie.h"
#include "wire/peer.h"

namespace {

using namespace hapticd;

// Whatever is computed must not be optimised away.
double sum = 0;

void ticks(bench::Act act, int rounds) {
  constexpr base::Nanos kPeriod = 1'000'000;
  const auto scene = bench::sceneOf(bench::bumpyBall(10'000));
  realtime::Renderer renderer;
  device::DeviceState hand;
  realtime::Rendering out;
  for (int i = 0; i < rounds; ++i) {
    hand.position_m = bench::handAt(act, i * 1e-3);
    if (i == 0) hand.position_m *= 1.1;  // comes from outside
    renderer.step(*scene, hand, i * kPeriod, kPeriod, out);
    sum += out.force_N.x();
  }
}

// What a tick says to a client.
void encodeOnce(wire::FrameEncoder& encoder) {
  const wire::LocalSender sender{0};
  const wire::Time time{1, 2};
  encoder.add(time, sender, wire::TrackerPosQuat{.sensor = 0, .filler = 0, .position = {1, 2, 3}});
  encoder.add(time, sender, wire::Force{{1, 2, 3}});
  encoder.add(time, sender, wire::Dop{0.001});
  encoder.add(time, sender, wire::IsTouching{1});
  encoder.add(time, sender, wire::TickReport{});
}

void encode(int rounds) {
  wire::FrameEncoder encoder;
  for (int i = 0; i < rounds; ++i) {
    encoder.clear();
    encodeOnce(encoder);
    sum += static_cast<double>(encoder.bytes().size());
  }
}

// A stream of vertices through an endpoint.
void decode(int rounds) {
  wire::LocalNames names;
  const wire::LocalSender sender = names.addSender("Phantom");
  wire::Peer from(names);
  wire::Peer to(names);
  const auto add = [](const wire::Event& event) {
    const auto* message = std::get_if<wire::MessageReceived>(&event);
    if (message == nullptr || message->kind != wire::kindOf<wire::SetVertex>) return;
    const auto vertex = wire::decode<wire::SetVertex>(message->payload);
    if (vertex) sum += vertex->position[1];
  };
  to.feed({}, wire::encodeCookie(0), add);
  from.feed({}, wire::encodeCookie(0), add);
  std::vector<std::byte> bytes;
  from.takeStream(bytes);  // the cookie and the descriptions
  to.feed({}, std::span(bytes).subspan(wire::kCookieBytes), add);
  for (std::int32_t i = 0; i < 100; ++i) from.send({}, sender, wire::SetVertex{0, i, {1, 2, 3}});
  from.takeStream(bytes);
  for (int i = 0; i < rounds; ++i) to.feed({}, bytes, add);
}

// Bodies that all move by themselves, as in a simulation of physics, and their publication.
void poses(int rounds) {
  constexpr std::int32_t kBodies = 24;
  scene::SceneConfig config;
  config.checkMeshes = false;
  scene::SceneBuilder builder(config);
  std::vector<scene::Notice> notices;
  base::Nanos now = 0;
  geometry::TriangleMesh triangle;
  triangle.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  triangle.triangles = {{0, 1, 2}};
  for (std::int32_t body = 0; body < kBodies; ++body) bench::tell(builder, body, triangle, now);
  for (int i = 0; i < rounds; ++i) {
    now += 1'000'000'000;  // the meshes are due, and each motion is over when the next one begins
    builder.apply(1, scene::BeginBatch{}, now, notices);
    for (std::int32_t body = 0; body < kBodies; ++body) {
      scene::SetTransform pose{body, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
      pose.matrix[12] = 0.01 * ((i + 1) % 2) * (body + 1);
      builder.apply(1, std::move(pose), now, notices);
    }
    builder.apply(1, scene::CommitBatch{}, now, notices);
    const auto snapshot = builder.publish(now, notices);
    sum += static_cast<double>(snapshot->objects.size());
  }
}

void run(const std::string& what, int rounds) {
  for (const bench::Act act : bench::kActs) {
    if (what == bench::nameOf(act)) return ticks(act, rounds);
  }
  if (what == "encode") return encode(rounds);
  if (what == "decode") return decode(rounds);
  if (what == "poses") return poses(rounds);
  throw std::invalid_argument("nothing is called '" + what + "'");
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3)
    throw std::invalid_argument("usage: hapticd_counted contact|slide|tap|encode|decode|poses ROUNDS");
  run(argv[1], std::stoi(argv[2]));
  std::printf("%g\n", sum);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
