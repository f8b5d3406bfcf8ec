// Remote contacts and held forces from the wire to the force on the hand: the sets are within their limits,
// and the force is finite and grows by no more than its rate.
#include <algorithm>
#include <cmath>
#include <string>

#include "fuzz/targets.h"
#include "realtime/remote/held_force.h"
#include "realtime/remote/remote_contacts.h"
#include "server/station/streamed_input.h"
#include "wire/codec.h"

namespace hapticd::fuzz {
namespace {

constexpr base::Nanos kPeriod = 1'000'000;
const geometry::Vec3 kHand_m = geometry::Vec3::Zero();  // in the last report

void checkSet(const realtime::RemoteContactSet& set, base::Nanos now) {
  require(set.count <= realtime::kMaxRemoteContacts, "at most sixteen contacts");
  require(set.stated <= now && set.received <= now, "nothing is stated in the future");
  for (std::uint32_t i = 0; i < set.count; ++i) {
    const realtime::RemoteContact& c = set.contacts[i];
    require(c.point_m.allFinite() && std::isfinite(c.radius_m), "places are finite");
    require(std::abs(c.normal.norm() - 1) < 1e-6, "normals are unit vectors");
    const geometry::Vec3 toLimited = c.shape == realtime::RemoteShape::halfSpace
                                         ? geometry::Vec3(kHand_m - c.point_m)
                                         : geometry::Vec3(-c.radius_m * c.normal);
    const geometry::Vec3 limited_m_per_s = c.velocity_m_per_s + c.angularVelocity_rad_per_s.cross(toLimited);
    const double rounding_m_per_s = 1e-14 * realtime::kRemoteTurn_rad_per_s * toLimited.norm();
    require(limited_m_per_s.norm() <= realtime::kRemoteSpeed_m_per_s * 1.000001 + rounding_m_per_s,
            "speeds are bounded");
    require(c.stiffness_N_per_m > 0 && c.stiffness_N_per_m < 1e5 && c.damping_Ns_per_m >= 0, "stiffness");
    require(c.lifetime > 0 && c.lifetime <= realtime::kLongestRemoteLife, "lifetimes are bounded");
    for (std::uint32_t j = 0; j < i; ++j) require(set.contacts[j].id != c.id, "ids differ");
  }
}

}  // namespace

// A run of messages: kind and client in one byte, ticks before it, length in two bytes, payload.
void remote_input(Input input) {
  server::StreamedInput::Slot slot;
  scene::SceneConfig config;
  server::StreamedInput streams(slot, config, {}, false);
  realtime::RemoteContacts contacts;
  realtime::HeldForceLaw held;
  realtime::TickReport last;
  last.tick = 1;
  base::Nanos now = 1'000'000'000;
  double angle = 0;
  int steps = 0;
  while (input.size() >= 4 && steps < 400) {
    const unsigned head = static_cast<unsigned>(input[0]);
    const unsigned ticks = static_cast<unsigned>(input[1]) % 40U;
    const std::size_t length = std::min<std::size_t>(
        static_cast<std::size_t>(input[2]) << 8U | static_cast<std::size_t>(input[3]), input.size() - 4);
    const Input payload = input.subspan(4, length);
    input = input.subspan(4 + length);
    const scene::ClientId client = head >> 6U;
    if (head % 3 == 0) {
      if (const auto message = wire::decode<wire::RemoteContacts>(payload))
        streams.on(client, *message, last, now);
    } else if (head % 3 == 1) {
      if (const auto message = wire::decode<wire::HeldForce>(payload))
        streams.on(client, *message, last, now);
    } else {
      streams.clientGone(client);
    }
    for (unsigned i = 0; i < ticks; ++i, ++steps) {
      now += kPeriod;
      angle += 0.05;
      const realtime::RemoteInput& newest = slot.read();
      checkSet(newest.contacts, now);
      const geometry::Vec3 hip(0.02 * std::sin(angle), 0.03 * std::cos(0.7 * angle),
                               0.01 * std::sin(2 * angle));
      realtime::RemoteRendering out;
      const geometry::Vec3 force = contacts.step(
          newest.contacts, {.position_m = hip, .velocity_m_per_s = {0.1, -0.1, 0.05}, .scene = {}}, now,
          0.001, out);
      require(force.allFinite(), "the force of contacts is finite");
      held.step(newest.force, hip, {0.1, -0.1, 0.05}, now, 0.001, 1, out);
      require(out.heldForce_N.allFinite() && std::isfinite(out.energy_J), "the held force is finite");
      require(out.count <= realtime::kMaxRemoteContacts, "at most sixteen contacts exert force");
    }
  }
}

}  // namespace hapticd::fuzz
