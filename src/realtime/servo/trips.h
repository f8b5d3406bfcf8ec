// Everything the guard can object to, by number, name, and what a VRPN client is told.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace hapticd::realtime {

/// Reasons for the written force to differ from the rendered one. Bit numbers in GuardReport.
enum class Trip : std::uint8_t {
  notFinite,
  peakForce,
  thermal,
  slew,
  speed,
  late,
  stalled,
  noState,
  notCalibrated,
  deadMan,
  inkwell,
  hot,
  deviceFault,
  stopped,
  disarmed,
  geometryJump,
  deepContact,
};
inline constexpr std::size_t kTripCount = 17;

/// Error codes of VRPN's force device.
enum class ForceError : std::int32_t {
  valueOutOfRange = 0,
  dutyCycle = 1,
  force = 2,
  misc = 3,
  ok = 4,
};

/// How a trip acts on the force.
enum class TripKind : std::uint8_t {
  clamp,  ///< shapes the force and goes on
  hold,   ///< zero force while it lasts, then the ramp
  latch,  ///< zero force until re-armed
};

struct TripInfo {
  Trip trip;
  std::string_view name;
  TripKind kind;
  ForceError error;
  std::string_view text;  ///< for a person: what happened and, where there is one, what to do
};

/// In the order of the enumeration.
inline constexpr std::array<TripInfo, kTripCount> kTrips{{
    {Trip::notFinite, "not_finite", TripKind::hold, ForceError::valueOutOfRange,
     "the rendered force or the device state was not a number"},
    {Trip::peakForce, "peak_force", TripKind::clamp, ForceError::force,
     "the rendered force was above the peak force of the device"},
    {Trip::thermal, "thermal", TripKind::clamp, ForceError::dutyCycle,
     "the mean force over 5 s reached what the device can hold for long"},
    {Trip::slew, "slew", TripKind::clamp, ForceError::force, "the force rose faster than 1 N in 1 ms"},
    {Trip::speed, "speed", TripKind::latch, ForceError::force,
     "the device moved faster than 1.2 m/s; hold it still and re-arm"},
    {Trip::late, "late", TripKind::hold, ForceError::misc, "a tick was more than 3 ms late"},
    {Trip::stalled, "stalled", TripKind::latch, ForceError::misc,
     "a tick was more than 50 ms late; re-arm when the machine is free again"},
    {Trip::noState, "no_state", TripKind::hold, ForceError::misc,
     "the device gave no state or did not take the force"},
    {Trip::notCalibrated, "not_calibrated", TripKind::hold, ForceError::misc, "the device is not calibrated"},
    {Trip::deadMan, "dead_man", TripKind::hold, ForceError::misc, "the dead-man or presence switch is open"},
    {Trip::inkwell, "inkwell", TripKind::hold, ForceError::misc, "the stylus is docked"},
    {Trip::hot, "hot", TripKind::hold, ForceError::dutyCycle, "the motors are too hot"},
    {Trip::deviceFault, "device_fault", TripKind::latch, ForceError::force,
     "the driver reports an error; re-arm when it is cleared"},
    {Trip::stopped, "stopped", TripKind::hold, ForceError::misc, "forces were stopped; re-arm to go on"},
    {Trip::disarmed, "disarmed", TripKind::hold, ForceError::misc, "forces are not enabled for this device"},
    {Trip::geometryJump, "geometry_jump", TripKind::clamp, ForceError::misc,
     "geometry under the hand changed by a jump; the force was blended"},
    {Trip::deepContact, "deep_contact", TripKind::clamp, ForceError::valueOutOfRange,
     "first contact was too deep; it is felt again once the hand has left"},
}};

constexpr std::uint32_t bit(Trip trip) noexcept {
  return std::uint32_t{1} << static_cast<unsigned>(trip);
}
constexpr const TripInfo& info(Trip trip) noexcept {
  return kTrips[static_cast<std::size_t>(trip)];
}
/// The set of trips of one kind.
constexpr std::uint32_t tripsOf(TripKind kind) noexcept {
  std::uint32_t bits = 0;
  for (const TripInfo& trip : kTrips) bits |= trip.kind == kind ? bit(trip.trip) : 0;
  return bits;
}

}  // namespace hapticd::realtime
