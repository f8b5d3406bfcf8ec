#include "server/station/streamed_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/time.h"
#include "realtime/remote/remote_shape.h"
#include "scene/passivity.h"
#include "scene/surface_settings.h"
#include "scene/workspace.h"
#include "server/reports/client_tick.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using geometry::Vec3;
using realtime::RemoteContact;
using realtime::RemoteContactSet;
using realtime::RemoteShape;

constexpr Nanos kTextPeriod = 1'000'000'000;
constexpr Nanos kShortestLife = 10'000'000;
constexpr Nanos kLongestJitter = 50'000'000;
constexpr Nanos kUnknownRoundTrip = 100'000'000;  // of a client that does not measure it
constexpr Nanos kLongestRoundTrip = 1'000'000'000;
constexpr Nanos kDrift = 50'000;         // of the two clocks between two messages, at most
constexpr double kRoundTripLasts_s = 1;  // in which it falls to 1/e, unless it comes again
constexpr Nanos kTogether = 5'000'000;   // messages that waited for each other arrive within it
constexpr double kNarrow_m = 0.005;      // between surfaces that may squeeze the hand
constexpr std::int64_t kLatestStamp = 4'000'000'000'000'000'000;  // 127 years
constexpr double kSoftest_N_per_m = 1;                            // a softer contact is none
constexpr double kThinnest_m = 1e-4;
constexpr double kLargest = 1e9;

// From a client's frame and units to the device's.
class ToDevice {
 public:
  explicit ToDevice(const realtime::TickReport& last) {
    const geometry::Affine T_world_device =
        last.tick == 0 ? scene::Workspace{}.T_world_device : last.T_world_device;
    T_device_world_ = T_world_device.inverse();
    const geometry::Mat3 linear = T_device_world_.linear();
    scale_ = geometry::scaleOf(linear);
    rotation_ = linear / scale_;
  }
  Vec3 position(const double* n) const {
    return T_device_world_ * Vec3(kWorldPerReported * Vec3(n[0], n[1], n[2]));
  }
  Vec3 vector(const double* n) const {
    return kWorldPerReported * (T_device_world_.linear() * Vec3(n[0], n[1], n[2]));
  }
  Vec3 direction(const double* n) const { return rotation_ * Vec3(n[0], n[1], n[2]); }
  double length(double reported) const { return kWorldPerReported * scale_ * reported; }

 private:
  geometry::Affine T_device_world_;
  geometry::Mat3 rotation_;
  double scale_ = 1;
};

// A stamp beyond any clock counts as none.
std::int64_t stampOf(std::int64_t time) {
  return time > -kLatestStamp && time < kLatestStamp ? time : 0;
}

Vec3 atMost(const Vec3& v, double limit) {
  const double size = v.norm();
  return size > limit ? Vec3(limit / size * v) : v;
}

Nanos lifetimeOf(double lifetime_s) {
  return std::clamp(base::toNanos(std::clamp(lifetime_s, 0.0, 1.0)), kShortestLife,
                    realtime::kLongestRemoteLife);
}

bool usable(const double* numbers, std::size_t count) {
  return std::all_of(numbers, numbers + count,
                     [](double x) { return std::isfinite(x) && std::abs(x) <= kLargest; });
}

// The numbers of one contact, see wire::RemoteContacts. Returns why they are none, or an empty text.
std::string contactOf(const double* n, const ToDevice& toDevice, const Vec3& hand_m, RemoteContact& contact) {
  if (!usable(n, wire::RemoteContacts::kNumbers)) return "a number is not finite or too large";
  if (!(n[1] == 0 || n[1] == 1 || n[1] == 2))  // wire::RemoteShape
    return fmt::format("shape {} is unknown; use 0 (half-space), 1 (sphere) or 2 (cylinder)", n[1]);
  contact.id = static_cast<std::int32_t>(std::clamp(n[0], -2147483648.0, 2147483647.0));
  contact.shape = static_cast<RemoteShape>(static_cast<int>(n[1]));
  contact.radius_m = toDevice.length(n[2]);
  if (contact.shape != RemoteShape::halfSpace && std::abs(contact.radius_m) < kThinnest_m)
    return fmt::format("radius {} m is smaller than 0.1 mm of the device", n[2]);
  contact.point_m = toDevice.position(n + 3);
  contact.normal = toDevice.direction(n + 6);
  if (contact.normal.norm() < 1e-6) return "the normal is zero";
  contact.normal.normalize();
  contact.axis = toDevice.direction(n + 9);
  if (contact.shape == RemoteShape::cylinder) {
    contact.axis -= contact.normal.dot(contact.axis) * contact.normal;
    if (contact.axis.norm() < 1e-6) return "the axis of the cylinder is zero or along the normal";
    contact.axis.normalize();
  }
  // A wheel whose rim is too fast still turns about its centre. A flat surface is limited where the hand is,
  // however far away the client names it.
  const Vec3 turning = toDevice.direction(n + 15);
  const Vec3 fromLimited = contact.shape == RemoteShape::halfSpace ? Vec3(contact.point_m - hand_m)
                                                                   : Vec3(contact.radius_m * contact.normal);
  contact.angularVelocity_rad_per_s = atMost(turning, realtime::kRemoteTurn_rad_per_s);
  contact.velocity_m_per_s =
      atMost(toDevice.vector(n + 12) - turning.cross(fromLimited), realtime::kRemoteSpeed_m_per_s) +
      contact.angularVelocity_rad_per_s.cross(fromLimited);
  contact.stiffness_N_per_m = n[18];
  contact.damping_Ns_per_m = std::max(n[19], 0.0);
  contact.staticFriction = std::clamp(n[20], 0.0, 1.0);
  contact.dynamicFriction = std::clamp(n[21], 0.0, contact.staticFriction);
  contact.lifetime = lifetimeOf(n[22]);
  contact.yields = n[23] != 0;
  return {};
}

// By how much two surfaces that the hand may touch both within their life are stiffer, in the direction from
// one to the other, than one: by nothing at a right angle, by all of it where they face each other.
double opposition(const RemoteContact& a, const RemoteContact& b, const Vec3& hand_m) {
  const realtime::SurfaceAt atA = realtime::surfaceAt(a, 0, hand_m);
  const realtime::SurfaceAt atB = realtime::surfaceAt(b, 0, hand_m);
  const double gap_m = -atA.depth_m - atB.depth_m;
  const double closing_m_per_s = atA.normal.dot(atA.velocity_m_per_s) + atB.normal.dot(atB.velocity_m_per_s);
  const double life_s = base::toSeconds(std::min(a.lifetime, b.lifetime));
  const bool mayTouch = gap_m - std::max(0.0, closing_m_per_s) * life_s < kNarrow_m;
  return mayTouch ? std::max(0.0, -atA.normal.dot(atB.normal)) : 0;
}

}  // namespace

// False when another client streams, with the refusal, or when the message is older than the newest.
bool StreamedInput::begin(Stream& stream, scene::ClientId client, std::int64_t time, Nanos received,
                          Refusal& refusal) {
  if (stream.client && *stream.client != client) {
    if (received < stream.until) {
      refusal = {RefusalCode::streamedByOther,
                 "refused: client " + std::to_string(*stream.client) +
                     " streams to this device; wait until its last value has expired"};
      return false;
    }
    stream = {};
  }
  // The clock of a simulation that starts again begins anew.
  if (stream.client && time != 0 && time < stream.newest) {
    if (received < stream.until) return false;
    stream = {};
  }
  if (!stream.client) stream.offset = received - time;
  stream.client = client;
  stream.newest = time;
  return true;
}

// When the values were true, on the servo clock: the receipt without the jitter of the way.
Nanos StreamedInput::statedAt(Stream& stream, std::int64_t time, Nanos received) const {
  if (time == 0) return received;
  stream.offset = std::min(stream.offset + kDrift, received - time);
  return std::clamp(time + stream.offset, received - kLongestJitter, received);
}

StreamedInput::Answer StreamedInput::answer(scene::ClientId client, Kind kind, Nanos now, bool taken,
                                            Refusal text) {
  if (!text.text.empty()) {
    Nanos& next = nextText_[{client, kind}];
    if (now < next) {
      text.text.clear();
    } else {
      next = now + kTextPeriod;
    }
  }
  return {taken, std::move(text)};
}

// The longest one of late that came twice: a single late message, as after a pause of the network, is none.
// Of messages that arrive together, faster than they were made, the servo feels the last.
void StreamedInput::measureRoundTrip(std::int64_t stateTime, Nanos received) {
  const Nanos measured =
      stateTime > 0 ? std::clamp<Nanos>(received - stateTime, 0, kLongestRoundTrip) : kUnknownRoundTrip;
  const Nanos gap = received - contacts_.way.measuredAt;
  const bool together = received - contacts_.burst < kTogether ||
                        (gap < kTogether && 2 * gap < stateTime - contacts_.stateTime);
  contacts_.stateTime = stateTime;
  if (!together) {
    contacts_.burst = received;
    contacts_.wayBefore = contacts_.way;
  }
  const Way& before = contacts_.wayBefore;
  const double left = std::exp(-base::toSeconds(received - before.measuredAt) / kRoundTripLasts_s);
  const auto ofLate = [left](Nanos longest) {
    return static_cast<Nanos>(left * static_cast<double>(longest));
  };
  contacts_.way = {std::max(ofLate(before.roundTrip), std::min(measured, before.longest)),
                   std::max(ofLate(before.longest), measured), received};
}

// As any surface: what the sampled and delayed loop can bear. Surfaces that push against each other share it,
// those of the scene that the hand touches, too.
std::string StreamedInput::keepWithinBounds(RemoteContactSet& set, const realtime::TickReport& last) const {
  const Vec3& hand_m = last.device.position_m;
  std::vector<RemoteContact> others(set.contacts.begin(), set.contacts.begin() + set.count);
  for (std::uint32_t i = 0; i < last.rendering.contactCount; ++i) {
    RemoteContact& face = others.emplace_back();
    face.point_m = hand_m;
    face.normal = last.rendering.contacts[i].normal;
  }
  std::string remark;
  for (std::uint32_t i = 0; i < set.count; ++i) {
    RemoteContact& contact = set.contacts[i];
    scene::SceneConfig config = config_;
    if (contact.yields) config.transportDelay_s += base::toSeconds(contacts_.way.roundTrip);
    double most = 0;
    for (const RemoteContact& other : others) most += opposition(contact, other, hand_m);
    config.ownDamping_Ns_per_m /= 1 + std::min(1.0, most);
    scene::Surface surface;
    surface.stiffness_N_per_m = contact.stiffness_N_per_m;
    surface.damping_Ns_per_m = contact.damping_Ns_per_m;
    std::string lowered;
    scene::keepPassive(surface, scene::PassivityBound(config), lowered);
    contact.stiffness_N_per_m = surface.stiffness_N_per_m;
    contact.damping_Ns_per_m = surface.damping_Ns_per_m;
    if (!lowered.empty() && remark.empty()) remark = fmt::format("contact {}: {}", contact.id, lowered);
  }
  return remark;
}

StreamedInput::Answer StreamedInput::on(scene::ClientId client, const wire::RemoteContacts& message,
                                        const realtime::TickReport& last, Nanos received) {
  constexpr std::size_t kNumbers = wire::RemoteContacts::kNumbers;
  const std::int64_t time = stampOf(message.time);
  Refusal text;
  if (!begin(contacts_, client, time, received, text)) {
    if (!text.text.empty()) text.text = "Remote_Contacts " + text.text;
    return answer(client, Kind::contacts, received, false, std::move(text));
  }
  const std::vector<double>& numbers = message.contacts.values;
  if (numbers.size() % kNumbers != 0) {
    text = {
        RefusalCode::streamInvalid,
        fmt::format("Remote_Contacts refused: {} numbers are no multiple of {}", numbers.size(), kNumbers)};
    return answer(client, Kind::contacts, received, false, std::move(text));
  }
  measureRoundTrip(message.stateTime, received);

  RemoteContactSet& set = input_.contacts;
  ++set.number;
  set.clientTime = time;
  set.received = received;
  set.stated = statedAt(contacts_, time, received);
  set.count = 0;
  contacts_.until = received;
  const ToDevice toDevice(last);
  for (std::size_t at = 0; at < numbers.size() && set.count < realtime::kMaxRemoteContacts; at += kNumbers) {
    RemoteContact& contact = set.contacts[set.count];
    const std::string wrong = contactOf(numbers.data() + at, toDevice, last.device.position_m, contact);
    if (!wrong.empty()) {
      text = {RefusalCode::streamInvalid,
              fmt::format("Remote_Contacts: contact {} ignored: {}", at / kNumbers, wrong)};
      continue;
    }
    const auto sameId = [&](const RemoteContact& c) { return c.id == contact.id; };
    if (std::any_of(set.contacts.begin(), set.contacts.begin() + set.count, sameId)) {
      text = {RefusalCode::streamInvalid,
              fmt::format("Remote_Contacts: contact id {} ignored the second time; give each its own",
                          contact.id)};
      continue;
    }
    if (contact.stiffness_N_per_m < kSoftest_N_per_m) continue;
    contacts_.until = std::max(contacts_.until, received + contact.lifetime);
    ++set.count;
  }
  const std::string remark = keepWithinBounds(set, last);
  if (text.text.empty() && !remark.empty()) text.text = "Remote_Contacts: " + remark;
  send();
  return answer(client, Kind::contacts, received, true, std::move(text));
}

StreamedInput::Answer StreamedInput::on(scene::ClientId client, const wire::HeldForce& message,
                                        const realtime::TickReport& last, Nanos received) {
  Refusal text;
  if (!usable(message.force.data(), 3) || !usable(message.torque.data(), 3) ||
      !usable(&message.lifetime, 1)) {
    text = {RefusalCode::streamInvalid, "Held_Force refused: a number is not finite or too large"};
    return answer(client, Kind::force, received, false, std::move(text));
  }
  const bool turns =
      std::any_of(message.torque.begin(), message.torque.end(), [](double t) { return t != 0; });
  if (turns && !rendersTorque_)
    text.text = "Held_Force: this device renders no torque; only the force is felt";
  return hold(client, stampOf(message.time), ToDevice(last).direction(message.force.data()),
              message.lifetime > 0 ? lifetimeOf(message.lifetime) : 0, received, std::move(text));
}

StreamedInput::Answer StreamedInput::on(scene::ClientId client, const Vec3& force_N, Nanos lifetime,
                                        Nanos received) {
  if (!usable(force_N.data(), 3)) {
    return answer(client, Kind::force, received, false,
                  {RefusalCode::streamInvalid, "force refused: a number is not finite or too large"});
  }
  return hold(client, 0, force_N, std::min(lifetime, realtime::kLongestRemoteLife), received, {});
}

StreamedInput::Answer StreamedInput::hold(scene::ClientId client, std::int64_t time, const Vec3& force_N,
                                          Nanos lifetime, Nanos received, Refusal remark) {
  Refusal refusal;
  if (!begin(force_, client, time, received, refusal)) {
    if (!refusal.text.empty()) refusal.text = "Held_Force " + refusal.text;
    return answer(client, Kind::force, received, false, std::move(refusal));
  }
  realtime::HeldForce& force = input_.force;
  ++force.number;
  force.clientTime = time;
  force.received = received;
  force.lifetime = lifetime;
  force.force_N = force_N;
  force.budget = budget_;
  force_.until = received + force.lifetime;
  send();
  return answer(client, Kind::force, received, true, std::move(remark));
}

void StreamedInput::clientGone(scene::ClientId client) {
  std::erase_if(nextText_, [client](const auto& entry) { return entry.first.first == client; });
  const bool contacts = contacts_.client == client;
  const bool force = force_.client == client;
  if (contacts) {
    contacts_ = {};
    ++input_.contacts.number;
    input_.contacts.count = 0;
  }
  if (force) {
    force_ = {};
    ++input_.force.number;
    input_.force.lifetime = 0;
  }
  if (contacts || force) send();
}

}  // namespace hapticd::server
