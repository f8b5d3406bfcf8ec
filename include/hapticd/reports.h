// What a haptics server reports, as plain values.
//
// Frame: positions, velocities and forces are in the frame of the client's world: +x right, +y up, +z towards
// the user, until a workspace command changes it. Quaternions are x y z w. Units: servers send world units
// divided by 1000, so `_m` means metres when the client's world is in millimetres. Forces are newtons,
// whatever the world unit. Time: every `time` is the wall clock of the server at the servo tick that produced
// the value, to a microsecond.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hapticd/export.h"
#include "hapticd/report_list.h"
#include "hapticd/trips.h"

namespace hapticd {

using Time = std::chrono::system_clock::time_point;
using Vec3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  ///< x y z w, of length 1

/// Pose of a sensor: 0 is the proxy, 1 the device itself, 2 the surface contact point.
struct PoseReport {
  Time time;
  int sensor = 0;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};  ///< from sensor to world
};

/// Velocity of a sensor, and the rotation that it performs within rotationInterval_s.
struct VelocityReport {
  Time time;
  int sensor = 0;
  Vec3 velocity_m_per_s{};
  Quaternion rotation{0, 0, 0, 1};
  double rotationInterval_s = 1;
};

/// Acceleration of a sensor, and the change of its rotation within rotationInterval_s. Servers of this
/// project send none.
struct AccelerationReport {
  Time time;
  int sensor = 0;
  Vec3 acceleration_m_per_s2{};
  Quaternion rotation{0, 0, 0, 1};
  double rotationInterval_s = 1;
};

/// A button was pressed or released. Buttons are counted from 0.
struct ButtonReport {
  Time time;
  int button = 0;
  bool pressed = false;
};

/// The value of every analog channel. Channels of servers of this project: the opening of the gripper (rad)
/// alone, and no report without a gripper; with Reports::contactAnalog, under the name NAME.touch, and with
/// `compat_mirrors` of the server: force x y z (N), depth (m), angle (degrees), touched object (-1: none),
/// then the opening, where there is a gripper.
struct AnalogReport {
  Time time;
  std::vector<double> channels;
};

/// The force written to the device, after the guard.
struct ForceReport {
  Time time;
  Vec3 force_N{};  ///< on the hand
};

/// Penetration depth: the distance from the device to the proxy along the surface normal, without what
/// friction holds aside; 0 without contact.
struct DepthReport {
  Time time;
  double depth_m = 0;
};

/// The surface contact point (SCP) and the orientation of the stylus.
struct ContactPointReport {
  Time time;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};  ///< from stylus to world
};

/// Whether anything is touched.
struct TouchingReport {
  Time time;
  bool touching = false;
};

/// The object that is touched, -1 for none and for planes.
struct TouchedObjectReport {
  Time time;
  int object = -1;
};

/// Angle between the stylus axis and the surface normal; 0 without contact.
struct AngleReport {
  Time time;
  double angle_deg = 0;
  bool touching = false;
};

/// A trip acts on the force, or none does any more (ForceError::recovered). GuardReport says which.
struct ForceErrorReport {
  Time time;
  ForceError error = ForceError::recovered;
};

/// Severity of a text message; the numbers are VRPN's.
enum class Severity { normal = 0, warning = 1, error = 2 };

/// A text message of the server for a person, one line of UTF-8: the server's control characters arrive as
/// U+FFFD. Refusals of commands arrive as Severity::error.
struct TextReport {
  Time time;
  Severity severity = Severity::normal;
  std::string text;
};

/// Pose of the tracker's base in the room; the answer to Client::requestToRoom().
struct ToRoomReport {
  Time time;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};
};

/// Mounting of the tracked unit on a sensor; the answer to Client::requestUnitToSensor(), once for each
/// sensor.
struct UnitToSensorReport {
  Time time;
  int sensor = 0;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};
};

/// Reach of the device in the world; the answer to Client::requestWorkspace().
struct WorkspaceReport {
  Time time;
  Vec3 min_m{};
  Vec3 max_m{};
};

/// One complete servo tick; see Client::subscribe().
struct TickReport {
  Time time;
  std::uint64_t tick = 0;               ///< counted by the server from 1 without gaps
  std::chrono::nanoseconds tickTime{};  ///< on the monotonic clock of the server
  std::uint64_t revision = 0;           ///< of the scene that was rendered
  Vec3 hand_m{};                        ///< haptic interface point: where the device is
  Vec3 proxy_m{};
  Vec3 velocity_m_per_s{};             ///< of the device
  Quaternion orientation{0, 0, 0, 1};  ///< from stylus to world
  Vec3 force_N{};                      ///< on the hand, as written to the device
  double depth_m = 0;
  int object = -1;            ///< the object with the largest force, -1 for none
  std::uint32_t buttons = 0;  ///< bit 0: button 0 is down
  Trips guardActive;          ///< trips that act in this tick
  Trips guardLatched;         ///< trips that hold the force at zero until Client::rearmForces()
};

/// Contact with one object.
struct Contact {
  int object = -1;  ///< -1: a plane
  Vec3 point_m{};
  Vec3 normal{};   ///< of length 1, out of the surface
  Vec3 force_N{};  ///< on the hand; the object receives the opposite
};

/// All contacts of one servo tick; empty once when the last contact ends. See Client::subscribe().
struct ContactsReport {
  Time time;
  std::uint64_t tick = 0;               ///< as in TickReport
  std::chrono::nanoseconds tickTime{};  ///< on the monotonic clock of the server
  std::vector<Contact> contacts;
};

/// A contact of Client::setRemoteContacts() that exerts force.
struct RemoteContactForce {
  int id = 0;
  Vec3 proxy_m{};  ///< the point of the rendered surface nearest to the device
  Vec3 force_N{};  ///< on the hand; the object receives the opposite
  double depth_m = 0;
};

/// What a client needs that streams contacts or forces: the newest tick at the time of sending. See
/// Client::subscribe().
struct HandReport {
  Time time;
  std::uint64_t tick = 0;               ///< as in TickReport
  std::chrono::nanoseconds tickTime{};  ///< on the monotonic clock of the server
  /// When this client sent the newest contacts and force that the tick knows, on its own
  /// std::chrono::steady_clock; 0: none.
  std::chrono::nanoseconds contactsSent{};
  std::chrono::nanoseconds forceSent{};
  Vec3 position_m{};                   ///< haptic interface point: where the device is
  Quaternion orientation{0, 0, 0, 1};  ///< from stylus to world
  Vec3 velocity_m_per_s{};
  Vec3 angularVelocity_rad_per_s{};
  Vec3 force_N{};       ///< on the hand, as written to the device: all forces together
  Vec3 heldForce_N{};   ///< the part of Client::setForce(), before the guard
  double energy_J = 0;  ///< that the held force may still add to the hand
  std::optional<double> gripper_rad;
  std::uint32_t buttons = 0;     ///< bit 0: button 0 is down
  bool energySpent = false;      ///< the part of the held force that adds power is cut
  bool correctionsHeld = false;  ///< a remote contact moved without a stated velocity and waits for energy
  Trips guardActive;
  std::vector<RemoteContactForce> contacts;
};

/// State of the guard: why the force may differ from the rendered one. Sent on change and to each new client.
struct GuardReport {
  Time time;
  Trips active;          ///< holds and latches that act now; clamps are not reported here
  Trips latched;         ///< trips that hold the force at zero until Client::rearmForces()
  bool armed = false;    ///< forces are enabled for the device
  bool stopped = false;  ///< a client stopped the forces
};

/// The connection was established, or lost for the given reason.
struct ConnectionReport {
  Time time;  ///< on the clock of the client
  bool connected = false;
  std::string reason;  ///< empty when connected
};

/// Kinds of reports, for statistics.
enum class ReportKind {
#define HAPTICD_ENUMERATOR(name, Type, text) name,
  HAPTICD_REPORTS(HAPTICD_ENUMERATOR)
#undef HAPTICD_ENUMERATOR
};
#define HAPTICD_ONE(name, Type, text) +1
inline constexpr std::size_t kReportKinds = 0 HAPTICD_REPORTS(HAPTICD_ONE);
#undef HAPTICD_ONE

/// A name for people, such as "contact point".
HAPTICD_EXPORT std::string_view nameOf(ReportKind kind) noexcept;
/// "value out of range", "duty cycle", "force", "recovered" or "other".
HAPTICD_EXPORT std::string_view nameOf(ForceError error) noexcept;
/// "normal", "warning" or "error".
HAPTICD_EXPORT std::string_view nameOf(Severity severity) noexcept;

/// The newest report of each kind. Each is default-constructed, with the time 0, until the first one arrives;
/// all are reset when the connection is lost.
struct LatestReports {
  std::map<int, PoseReport> pose;          ///< by sensor
  std::map<int, VelocityReport> velocity;  ///< by sensor
  std::map<int, bool> pressed;             ///< by button
  AnalogReport analog;
  ForceReport force;
  DepthReport depth;
  ContactPointReport contactPoint;
  TouchingReport touching;
  TouchedObjectReport touchedObject;
  AngleReport angle;
  TickReport tick;
  ContactsReport contacts;
  GuardReport guard;
  HandReport hand;
};

}  // namespace hapticd
