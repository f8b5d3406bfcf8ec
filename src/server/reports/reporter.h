// What clients are told: ticks of the servo into wire messages, on change and at a rate.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.h"
#include "server/reports/view.h"
#include "wire/message.h"

namespace hapticd::server {

/// A message to send, and whether it must not be lost although its kind usually may be.
struct Outgoing {
  wire::Message message;
  bool reliable = false;
};

/// What a client has chosen to hear.
struct ReportChoice {
  std::uint32_t kinds = wire::kReportDefault;  ///< wire::ReportKinds
  double rate_Hz = 1000;
  friend auto operator<=>(const ReportChoice&, const ReportChoice&) = default;
};

/// Tracker sensors of a device.
inline constexpr std::int32_t kSensorProxy = 0;
inline constexpr std::int32_t kSensorHip = 1;
inline constexpr std::int32_t kSensorContact = 2;
inline constexpr std::int32_t kSensors = 3;

/// Where reported poses of the tracker count from, and how the buttons stand: what clients may set.
struct ReportFrame {
  geometry::Vec3 origin = geometry::Vec3::Zero();  ///< reported metres
  geometry::Quat turn = geometry::Quat::Identity();
  std::uint32_t buttons = 0;  ///< of the device, through toggles
};

/// Remembers what was said last and says what changed since. One for each choice of reports; net thread.
/// Pure: no clock, no socket. Contact is mirrored for clients that know no force device: the button after the
/// device's own is "touching", and the analog channels are force x y z, depth, angle, touched object and,
/// where the device has one, the opening of its gripper in radians.
class Reporter {
 public:
  Reporter(const DeviceConfig& config, int buttonCount, const ReportChoice& choice);

  /// Appends what is to be said about this tick: buttons and errors at once, the rest when a report period is
  /// over.
  void update(const realtime::TickReport& tick, const ReportFrame& frame, std::vector<Outgoing>& out);

  /// Appends the present state of everything, for a client that has just come.
  void presentState(const realtime::TickReport& tick, const ReportFrame& frame,
                    std::vector<Outgoing>& out) const;

  /// Every button of the device, and "touching".
  static wire::ButtonStates buttonStates(int buttonCount, std::uint32_t buttons, bool touching);

 private:
  void guard(const realtime::TickReport& tick, std::vector<Outgoing>& out);
  void buttons(std::uint32_t buttons, std::vector<Outgoing>& out);
  void tracker(const View& view, const ReportFrame& frame, std::vector<Outgoing>& out);
  bool contact(const View& view, std::vector<Outgoing>& out);
  bool gripped(const View& view) const;
  void contactEnd(const View& view, std::vector<Outgoing>& out);
  void analog(const View& view, bool reliable, std::vector<Outgoing>& out);
  void wholeTick(const realtime::TickReport& tick, const View& view, bool over, std::vector<Outgoing>& out);

  bool wants(std::uint32_t kind) const noexcept { return (choice_.kinds & kind) != 0; }
  bool moved(std::int32_t sensor, const geometry::Vec3& position, const geometry::Quat& orientation);
  wire::F64x4 quaternion(const geometry::Quat& q) const;

  const DeviceConfig config_;
  const int buttonCount_;
  const ReportChoice choice_;
  base::Nanos period_;
  base::Nanos due_ = 0;

  struct Sent {
    geometry::Vec3 position = geometry::Vec3::Constant(1e300);
    geometry::Quat orientation = geometry::Quat::Identity();
  };
  std::array<Sent, kSensors> sensors_;
  std::uint32_t buttons_ = 0;
  bool touching_ = false;
  std::int32_t object_ = -1;
  geometry::Vec3 force_N_ = geometry::Vec3::Zero();
  double depth_ = 0;
  double angle_deg_ = 0;
  std::optional<double> gripper_rad_;
  geometry::Vec3 scp_ = geometry::Vec3::Constant(1e300);
  std::uint32_t tripped_ = 0;  ///< bits of the trips that took the force away
  wire::GuardState guard_;
};

}  // namespace hapticd::server
