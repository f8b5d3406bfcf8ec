#include "server/station/device_control.h"

#include <algorithm>
#include <cmath>

#include "server/reports/client_tick.h"
#include "server/session/identity.h"

namespace hapticd::server {
namespace {

using geometry::Quat;
using geometry::Vec3;

// The end of a refusal because of a stop whose program is gone or not.
std::string whoMayRearm(bool gone, const DeviceControl::Sender& sender) {
  std::string text = gone ? " and is gone" : "; it may re-arm";
  if (sender.hasSocket) {
    return text + (gone ? "; an operator may re-arm" : ", or an operator") +
           ", or the server's user on its machine: 'hapticd stop --rearm NAME@host', or NAME@unix:PATH if "
           "its socket is elsewhere";
  }
  if (sender.hasOperators) return text + (gone ? "; an operator may re-arm" : ", or an operator");
  return text + (gone ? "; a page of the server in a browser may re-arm" : "");
}

bool finite(const wire::HoldHand& m) {
  const auto ok = [](double x) { return std::isfinite(x); };
  return std::all_of(m.position.begin(), m.position.end(), ok) &&
         std::all_of(m.orientation.begin(), m.orientation.end(), ok);
}

}  // namespace

bool DeviceControl::Stop::isOf(const Sender& sender) const noexcept {
  const bool sameKey = key != 0 && key == sender.key;
  return sameKey || std::find(clients.begin(), clients.end(), sender.client) != clients.end();
}

// Another connection with the key may never have sent a stop.
bool DeviceControl::isGone(const Stop& stop) const {
  if (!stop.clients.empty()) return false;
  return stop.key == 0 || std::none_of(keys_.begin(), keys_.end(),
                                       [&](const auto& entry) { return entry.second == stop.key; });
}

void DeviceControl::stopForces(const Order& order, const Sender& sender) {
  constexpr std::size_t kMostGone = 32;
  stop_ = order;
  guard_.stop(order.received);
  ++stopsOfClients_;
  const auto own = std::find_if(stops_.begin(), stops_.end(), [&](const Stop& s) { return s.isOf(sender); });
  if (own != stops_.end()) {
    if (std::find(own->clients.begin(), own->clients.end(), sender.client) == own->clients.end())
      own->clients.push_back(sender.client);
    return;
  }
  stops_.push_back({sender.key, {sender.client}, sender.description});
  // One that is forgotten only merges with others that their programs can no longer undo.
  const auto gone = [](const Stop& stop) { return stop.clients.empty(); };
  if (static_cast<std::size_t>(std::count_if(stops_.begin(), stops_.end(), gone)) <= kMostGone) return;
  const auto first = std::find_if(stops_.begin(), stops_.end(), gone);
  const auto second = std::find_if(first + 1, stops_.end(), gone);
  second->key = 0;
  stops_.erase(first);
}

bool DeviceControl::rearmForces(const Order& order, const Sender& sender, bool faults, Refusal& refusal) {
  // One connection keeps its order by itself.
  const bool otherConnection =
      sourceOf(order.address) == sourceOf(stop_.address) && order.client != stop_.client;
  const bool sentEarlier =
      otherConnection && order.sent < stop_.sent && stop_.sent - order.sent <= kLongestTravel;
  const Refusal later{RefusalCode::none, "Rearm_Forces ignored: the forces were stopped after it was sent"};
  const std::uint32_t stops = guard_.stops();  // before the time: a stop sets that first
  if (order.received <= std::max(stop_.received, guard_.stoppedAt()) || sentEarlier) {
    refusal = later;
    return false;
  }
  const auto gone = [this](const Stop& stop) { return isGone(stop); };
  const std::vector<Stop> before = stops_;
  const bool undoes = std::erase_if(stops_, [&](const Stop& stop) { return stop.isOf(sender); }) > 0;
  if (sender.isOperator || (sender.isPage && sender.mayCommand && !sender.hasOperators &&
                            std::all_of(stops_.begin(), stops_.end(), gone))) {
    stops_.clear();
  }
  if (!stops_.empty()) {
    const Stop& other = stops_.back();
    refusal = {RefusalCode::stoppedByOther, "Rearm_Forces refused: " + other.description +
                                                " stopped the forces" + whoMayRearm(gone(other), sender)};
    return false;
  }
  const bool otherStop = stops - stopsBefore_ != stopsOfClients_;  // a signal, or a machine that slept
  if (!sender.mayCommand && (!undoes || faults || otherStop)) {
    stops_ = before;
    refusal = {RefusalCode::notPermitted,
               "Rearm_Forces refused: this client may undo its own stop only, not " +
                   std::string(faults                ? "faults"
                               : otherStop && undoes ? "that of the server's machine"
                                                     : "others'")};
    return false;
  }
  if (!guard_.rearm(stops)) {
    stops_ = before;
    refusal = later;
    return false;
  }
  stopsBefore_ = stops;
  stopsOfClients_ = 0;
  return true;
}

bool DeviceControl::hold(scene::ClientId client, const wire::HoldHand& wanted,
                         const geometry::Affine& T_world_device, Refusal& refusal) {
  if (hand_ == nullptr) {
    refusal = {RefusalCode::handNotSimulated,
               std::string("Hold_Hand refused: ") +
                   (isReal_ ? "the device is real" : "this device follows a recorded hand") +
                   "; only a simulated hand can be held"};
    return false;
  }
  if (holder_ && *holder_ != client) {
    // Releasing a hand that another client holds is not an error.
    if (wanted.hold == 0) return true;
    refusal = {RefusalCode::handHeldByOther,
               "Hold_Hand refused: client " + std::to_string(*holder_) + " holds the hand"};
    return false;
  }
  if (wanted.hold == 0) {
    releaseHand();
    return true;
  }
  if (!finite(wanted)) {
    refusal = {RefusalCode::handPoseInvalid, "Hold_Hand refused: position or orientation is not finite"};
    return false;
  }
  const Quat orientation(wanted.orientation[3], wanted.orientation[0], wanted.orientation[1],
                         wanted.orientation[2]);
  if (orientation.norm() < 1e-6) {
    refusal = {RefusalCode::handPoseInvalid,
               "Hold_Hand refused: the orientation is a zero quaternion; 0 0 0 1 is no rotation"};
    return false;
  }
  device::HandPose pose;
  const Vec3 world(wanted.position[0], wanted.position[1], wanted.position[2]);
  pose.position_m = (T_world_device.inverse() * world).cwiseMax(workspace_m_.min).cwiseMin(workspace_m_.max);
  pose.orientation = (Quat(rotationOf(T_world_device)).conjugate() * orientation).normalized();
  pose.buttons = wanted.buttons;
  // The map to the device multiplies: finite numbers may leave it infinite or undefined.
  if (!pose.position_m.allFinite() || !pose.orientation.coeffs().allFinite()) {
    refusal = {RefusalCode::handPoseInvalid,
               "Hold_Hand refused: position or orientation is too large for the workspace"};
    return false;
  }
  holder_ = client;
  hand_->setTarget(pose);
  return true;
}

void DeviceControl::letGo(scene::ClientId client) {
  if (holder_ == client) releaseHand();
}

void DeviceControl::clientGone(scene::ClientId client) {
  letGo(client);
  keys_.erase(client);
  for (Stop& stop : stops_) std::erase(stop.clients, client);
}

void DeviceControl::releaseHand() {
  if (!std::exchange(holder_, std::nullopt)) return;
  hand_->releaseTarget();
}

}  // namespace hapticd::server
