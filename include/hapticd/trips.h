// Trips: the reasons for which the guard changes the force. One table for server, clients, recordings and
// documents.
//
// A set of trips travels as a bit field: GuardReport and TickReport hold it as Trips. Bit numbers and names
// never change their meaning; new trips are appended, so a client may meet bits that it does not know.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace hapticd {

/// One reason for the written force to differ from the rendered one. The value is the bit number on the wire.
enum class Trip : std::uint8_t {
  notFinite = 0,
  peakForce = 1,
  thermal = 2,
  slew = 3,
  speed = 4,
  late = 5,
  stalled = 6,
  noState = 7,
  notCalibrated = 8,
  deadMan = 9,
  inkwell = 10,
  hot = 11,
  deviceFault = 12,
  stopped = 13,
  disarmed = 14,
  geometryJump = 15,
  deepContact = 16,
};
inline constexpr std::size_t kTripCount = 17;

/// How a trip acts on the force.
enum class TripAction : std::uint8_t {
  clamp,  ///< shapes the force, rendering continues
  hold,   ///< zero force while the cause lasts, then the force ramps in
  latch,  ///< zero force until the forces are re-armed
};

/// Error codes of VRPN's force device (`Force_Error`).
enum class ForceError : std::int32_t {
  valueOutOfRange = 0,
  dutyCycle = 1,
  force = 2,
  other = 3,
  recovered = 4,  ///< no trip acts any more
};

struct TripInfo {
  Trip trip;
  std::string_view name;  ///< identifier in JSON, CSV, MCAP, metrics and documents
  TripAction action;
  ForceError forceError;    ///< what a client of stock VRPN receives; clamps are never sent
  std::string_view what;    ///< one sentence: what happened
  std::string_view remedy;  ///< one sentence: what to do
};

/// All trips in the order of their bits: kTrips[i].trip has bit i.
inline constexpr std::array<TripInfo, kTripCount> kTrips{{
    {Trip::notFinite, "not_finite", TripAction::hold, ForceError::valueOutOfRange,
     "The rendered force or the device state was not a finite number.",
     "Check the meshes and effects for values that are not finite."},
    {Trip::peakForce, "peak_force", TripAction::clamp, ForceError::force,
     "The rendered force exceeded the peak force of the device.",
     "No action is needed; a lower stiffness or effect magnitude avoids it."},
    {Trip::thermal, "thermal", TripAction::clamp, ForceError::dutyCycle,
     "The mean force over 5 s reached the continuous force of the device.",
     "Press less for a few seconds; the full force returns by itself."},
    {Trip::slew, "slew", TripAction::clamp, ForceError::force,
     "The rendered force rose faster than 1 N in 1 ms.",
     "No action is needed; the force follows within a few milliseconds."},
    {Trip::speed, "speed", TripAction::latch, ForceError::force, "The device moved faster than 1.2 m/s.",
     "Hold the device still, then re-arm."},
    {Trip::late, "late", TripAction::hold, ForceError::other, "A servo tick was more than 3 ms late.",
     "Reduce the load on the machine; `hapticd doctor` checks its real-time settings."},
    {Trip::stalled, "stalled", TripAction::latch, ForceError::other, "A servo tick was more than 50 ms late.",
     "Re-arm when the machine is no longer overloaded."},
    {Trip::noState, "no_state", TripAction::hold, ForceError::other,
     "The device returned no state or did not accept the force.",
     "Check the cable and the power of the device."},
    {Trip::notCalibrated, "not_calibrated", TripAction::hold, ForceError::other,
     "The device is not calibrated.",
     "Start the server with --calibrate, or calibrate the device with the vendor's tool."},
    {Trip::deadMan, "dead_man", TripAction::hold, ForceError::other,
     "The dead-man or presence switch is open.", "Hold the stylus so that the switch closes."},
    {Trip::inkwell, "inkwell", TripAction::hold, ForceError::other, "The stylus is docked.",
     "Take the stylus out of the inkwell."},
    {Trip::hot, "hot", TripAction::hold, ForceError::dutyCycle, "The motors are too hot.",
     "Let the motors cool; the force returns by itself."},
    {Trip::deviceFault, "device_fault", TripAction::latch, ForceError::force, "The driver reports a fault.",
     "Clear the fault, then re-arm."},
    {Trip::stopped, "stopped", TripAction::hold, ForceError::other, "A client stopped the forces.",
     "Re-arm to continue."},
    {Trip::disarmed, "disarmed", TripAction::hold, ForceError::other,
     "Forces are not enabled for this device.", "Start the server with --enable-forces."},
    {Trip::geometryJump, "geometry_jump", TripAction::clamp, ForceError::other,
     "A command changed geometry or surface in contact at once, and the force was blended over 20 ms.",
     "No action is needed; smaller steps avoid it."},
    {Trip::deepContact, "deep_contact", TripAction::clamp, ForceError::valueOutOfRange,
     "An object appeared around the device or jumped over it, or the first contact was too deep: it exerts "
     "no force.",
     "Move the device out of the object; then the object can be felt."},
}};

/// The trip as a bit field with one bit set.
constexpr std::uint32_t bit(Trip trip) noexcept {
  return std::uint32_t{1} << static_cast<unsigned>(trip);
}
constexpr const TripInfo& infoOf(Trip trip) noexcept {
  return kTrips[static_cast<std::size_t>(trip)];
}
constexpr std::string_view nameOf(Trip trip) noexcept {
  return infoOf(trip).name;
}
/// The trip of a name as in TripInfo::name; nothing for an unknown name.
constexpr std::optional<Trip> tripOf(std::string_view name) noexcept {
  for (const TripInfo& info : kTrips) {
    if (info.name == name) return info.trip;
  }
  return std::nullopt;
}

/// A set of trips, as the bit field on the wire. Iterating gives the known trips in the order of their bits:
///   for (const Trip trip : report.active) std::cout << nameOf(trip) << '\n';
class Trips {
 public:
  constexpr Trips() noexcept = default;
  constexpr Trips(Trip trip) noexcept
      : bits_(bit(trip)) {}  // NOLINT(google-explicit-constructor): a set of one
  constexpr explicit Trips(std::uint32_t bits) noexcept : bits_(bits) {}
  /// All trips that act on the force in this way.
  static constexpr Trips thatAct(TripAction action) noexcept {
    std::uint32_t bits = 0;
    for (const TripInfo& info : kTrips) bits |= info.action == action ? bit(info.trip) : 0;
    return Trips(bits);
  }

  /// The bit field, with the bits that this version does not know.
  constexpr std::uint32_t bits() const noexcept { return bits_; }
  constexpr bool empty() const noexcept { return bits_ == 0; }
  constexpr bool contains(Trip trip) const noexcept { return (bits_ & bit(trip)) != 0; }
  /// Bits of trips that a newer server knows and this version does not.
  constexpr std::uint32_t unknownBits() const noexcept { return bits_ & ~kKnown; }

  class Iterator {
   public:
    using value_type = Trip;
    using difference_type = std::ptrdiff_t;
    constexpr Iterator() noexcept = default;
    constexpr explicit Iterator(std::uint32_t rest) noexcept : rest_(rest) {}
    constexpr Trip operator*() const noexcept { return static_cast<Trip>(std::countr_zero(rest_)); }
    constexpr Iterator& operator++() noexcept {
      rest_ &= rest_ - 1;
      return *this;
    }
    constexpr Iterator operator++(int) noexcept {
      const Iterator before = *this;
      ++*this;
      return before;
    }
    constexpr bool operator==(const Iterator&) const noexcept = default;

   private:
    std::uint32_t rest_ = 0;
  };
  constexpr Iterator begin() const noexcept { return Iterator(bits_ & kKnown); }
  constexpr Iterator end() const noexcept { return Iterator(); }

  constexpr bool operator==(const Trips&) const noexcept = default;
  friend constexpr Trips operator|(Trips a, Trips b) noexcept { return Trips(a.bits_ | b.bits_); }
  friend constexpr Trips operator&(Trips a, Trips b) noexcept { return Trips(a.bits_ & b.bits_); }
  /// The trips of a that are not in b.
  friend constexpr Trips operator-(Trips a, Trips b) noexcept { return Trips(a.bits_ & ~b.bits_); }

 private:
  static constexpr std::uint32_t kKnown = (std::uint32_t{1} << kTripCount) - 1;
  std::uint32_t bits_ = 0;
};

constexpr Trips operator|(Trip a, Trip b) noexcept {
  return Trips(a) | Trips(b);
}

/// Names of the known trips, joined: "speed+stopped". Empty for the empty set.
inline std::string namesOf(Trips trips, std::string_view separator = "+") {
  std::string names;
  for (const Trip trip : trips) {
    if (!names.empty()) names += separator;
    names += nameOf(trip);
  }
  return names;
}

}  // namespace hapticd
