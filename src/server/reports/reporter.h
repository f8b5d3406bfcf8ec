// Turns servo ticks into wire reports: on change, at the rate that a client chose.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "base/time.h"
#include "server/reports/client_tick.h"
#include "wire/message.h"
#include "wire/names.h"

namespace hapticd::server {

class MovingObjects;

/// A message to send. `reliable`: it must not be lost, although its kind is low-latency.
struct Outgoing {
  wire::Message message;
  bool reliable = false;
};

/// The subscription of a client.
struct ReportChoice {
  std::uint32_t kinds = wire::kReportDefault;  ///< wire::ReportKinds
  double rate_Hz = 1000;
  friend auto operator<=>(const ReportChoice&, const ReportChoice&) = default;
};

/// A sender under which clients know the device.
struct DeviceName {
  wire::LocalSender sender;
  View view = View::device;
};

/// The reports of a client without a subscription.
ReportChoice defaultChoice(const DeviceConfig& config);
/// The choice as this device serves it: with compat_mirrors the mirrors belong to tracker, button and analog.
ReportChoice withMirrors(const DeviceConfig& config, ReportChoice choice);

/// Tracker sensors of a device.
inline constexpr std::int32_t kSensorProxy = 0;
inline constexpr std::int32_t kSensorHip = 1;
inline constexpr std::int32_t kSensorContact = 2;
inline constexpr std::int32_t kSensorCount = 3;

/// Whether the last change of a value is to be sent once more, reliably: as a datagram it may have been lost,
/// and no further change would tell the client.
class LastChange {
 public:
  void changed(base::Nanos now) noexcept { due_ = now + kPause; }
  /// True once, when the value has not changed for a while.
  bool settles(base::Nanos now) noexcept {
    if (now < due_) return false;
    due_ = kNever;
    return true;
  }

 private:
  static constexpr base::Nanos kPause = 300'000'000;
  static constexpr base::Nanos kNever = std::numeric_limits<base::Nanos>::max();
  base::Nanos due_ = kNever;
};

/// Origin of the reported tracker poses, and the state of the buttons: both can be changed by clients.
struct ReportFrame {
  geometry::Vec3 origin = geometry::Vec3::Zero();  ///< reported metres
  geometry::Quat rotation = geometry::Quat::Identity();
  std::uint32_t buttons = 0;        ///< bits of the device's buttons, after ButtonModes
  MovingObjects* moving = nullptr;  ///< null: nothing moves
};

/// Keeps the last reported values and reports changes, and the last one of a value once more. One for each
/// ReportChoice; net thread; no clock and no socket. Contact can be mirrored for clients without a force
/// device: the button after the device's own is "touching", and the analog channels are force x y z, depth,
/// angle, touched object and, if the device has a gripper, its opening in radians. Without the mirror the
/// opening is the only analog channel.
class Reporter {
 public:
  Reporter(const DeviceConfig& config, int buttonCount, const ReportChoice& choice, View view = View::device);

  /// Appends the reports of this tick: once per report period, and when a contact begins or ends. Changes of
  /// buttons and of the guard are reported at once, too.
  void update(const realtime::TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out);
  /// The same for a tick that is too old to report: omits and counts what is due, unless contact begins or
  /// ends. The next update() reports the changes since the last report.
  void skip(const realtime::TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out);
  /// Number of ticks whose due reports skip() omitted since the last call.
  std::uint64_t takeSkipped() noexcept { return std::exchange(skipped_, 0); }

  /// Appends the whole state of this tick, for a client that has just subscribed.
  void presentState(const realtime::TickReport& tick, const ReportFrame& frame,
                    std::vector<Outgoing>& out) const {
    presentState(tick, frame, tick.rendering.touching, out);
  }
  /// The same with another state of the button "touching", which is reported with every tick, due or not.
  void presentState(const realtime::TickReport& tick, const ReportFrame& frame, bool touchButton,
                    std::vector<Outgoing>& out) const;

  /// The states of all buttons that this choice reports; "touching" is the last one.
  wire::ButtonStates buttonStates(std::uint32_t buttons, bool touching) const;
  /// Number of tracker sensors that this choice reports.
  std::int32_t sensorCount() const noexcept;

 private:
  void guard(const realtime::TickReport& tick, std::vector<Outgoing>& out);
  void buttons(std::uint32_t buttons, bool touching, std::vector<Outgoing>& out);
  void tracker(const ClientTick& clientTick, const ReportFrame& frame, std::vector<Outgoing>& out);
  void velocity(const ClientTick& clientTick, const geometry::Quat& toFrame, std::int32_t sensor,
                std::vector<Outgoing>& out) const;
  bool contact(const ClientTick& clientTick, std::vector<Outgoing>& out);
  bool gripperMoved(const ClientTick& clientTick) const;
  void contactEnd(const ClientTick& clientTick, std::vector<Outgoing>& out);
  void analog(const ClientTick& clientTick, bool reliable, std::vector<Outgoing>& out);
  void tickReport(const realtime::TickReport& tick, const ClientTick& clientTick, bool contactEnded,
                  std::vector<Outgoing>& out);
  void poses(const realtime::TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out);

  bool wants(std::uint32_t kind) const noexcept { return (choice_.kinds & kind) != 0; }
  bool moved(std::int32_t sensor, const geometry::Vec3& position, const geometry::Quat& orientation,
             double metre);
  wire::F64x4 quaternion(const geometry::Quat& q) const;

  const DeviceConfig config_;
  const int buttonCount_;
  const View view_;
  const ReportChoice choice_;
  base::Nanos period_;
  base::Nanos slack_;  ///< by which a tick may come before its report is due
  base::Nanos due_ = 0;
  base::Nanos now_ = 0;  ///< of the present tick

  struct Sent {
    geometry::Vec3 position = geometry::Vec3::Constant(1e300);
    geometry::Quat orientation = geometry::Quat::Identity();
    LastChange last;
  };
  std::array<Sent, kSensorCount> sensors_;
  std::uint32_t buttons_ = 0;
  std::uint64_t skipped_ = 0;
  std::size_t nextPose_ = 0;  ///< of more moving objects than fit into one message
  bool touchButton_ = false;
  bool touching_ = false;
  std::int32_t object_ = -1;
  geometry::Vec3 force_N_ = geometry::Vec3::Zero();
  double depth_ = 0;
  double angle_deg_ = 0;
  LastChange forceChange_;
  LastChange depthChange_;
  LastChange objectChange_;
  LastChange angleChange_;
  LastChange scpChange_;
  LastChange analogChange_;
  std::optional<double> gripper_rad_;
  geometry::Vec3 scp_ = geometry::Vec3::Constant(1e300);
  std::uint32_t reportedTrips_ = 0;  ///< bits of the trips that removed the force
  bool inside_ = false;              ///< an object is not felt because the HIP is inside
  base::Nanos insideTextDue_ = 0;
  wire::GuardState guard_;
};

}  // namespace hapticd::server
