// What clients are told: ticks of the servo into wire messages, on change and at a rate.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "realtime/servo/report.h"
#include "server/config.h"
#include "wire/messages.h"

namespace hapticd::server {

/// A message to send, and whether it must not be lost although its kind usually may be.
struct Outgoing {
  wire::Message message;
  bool reliable = false;
};

/// Tracker sensors of a device.
inline constexpr std::int32_t kSensorProxy = 0;
inline constexpr std::int32_t kSensorHip = 1;
inline constexpr std::int32_t kSensorContact = 2;

/// Remembers what was said last and says what changed since. One for each device and rate; net thread. Pure:
/// no clock, no socket.
class Reporter {
 public:
  Reporter(const DeviceConfig& config, int buttonCount, double rate_Hz);

  /// Appends what is to be said about this tick: buttons and errors at once, the rest when a report period is
  /// over.
  void update(const realtime::TickReport& tick, std::vector<Outgoing>& out);

  /// Appends the present state of everything, for a client that has just come.
  void presentState(const realtime::TickReport& tick, std::vector<Outgoing>& out) const;

  wire::ButtonStates buttonStates(std::uint32_t buttons) const;

 private:
  // One tick in the client's units: world / 1000, world frame, newtons.
  struct View;
  View viewOf(const realtime::TickReport& tick) const;

  void errors(const realtime::TickReport& tick, std::vector<Outgoing>& out);
  void buttons(const realtime::TickReport& tick, std::vector<Outgoing>& out);
  void tracker(const View& view, std::vector<Outgoing>& out);
  void contact(const View& view, std::vector<Outgoing>& out);
  void contactEnd(const View& view, std::vector<Outgoing>& out);

  bool moved(std::int32_t sensor, const geometry::Vec3& position, const geometry::Quat& orientation);
  wire::F64x4 quaternion(const geometry::Quat& q) const;

  const DeviceConfig config_;
  int buttonCount_;
  geometry::Nanos period_;
  geometry::Nanos due_ = 0;

  struct Sent {
    geometry::Vec3 position = geometry::Vec3::Constant(1e300);
    geometry::Quat orientation = geometry::Quat::Identity();
  };
  std::array<Sent, 3> sensors_;
  std::uint32_t buttons_ = 0;
  bool touching_ = false;
  std::int32_t object_ = -1;
  geometry::Vec3 force_N_ = geometry::Vec3::Zero();
  double depth_ = 0;
  double angle_deg_ = 0;
  geometry::Vec3 scp_ = geometry::Vec3::Constant(1e300);
  std::uint32_t tripped_ = 0;  ///< bits of the trips that took the force away
};

}  // namespace hapticd::server
