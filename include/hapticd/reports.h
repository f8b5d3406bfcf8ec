// What a haptics server reports, as plain values.
//
// Lengths, depths and velocities are in metres when the client's world is in millimetres: servers send world
// units divided by 1000. Forces are newtons. Positions and forces share the frame of the client's world: +x
// right, +y up, +z to the user, until a workspace message says otherwise. Quaternions are x y z w.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "hapticd/trips.h"

namespace hapticd {

/// Wall-clock time as the server stamped it: that of the servo tick that made the value, in microseconds.
using Time = std::chrono::system_clock::time_point;
using Vec3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  ///< x y z w

/// Where a sensor is; sensor 0 is the proxy, 1 the device itself, 2 the surface contact point.
struct PoseReport {
  Time time;
  int sensor = 0;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};
};

/// How fast a sensor moves, and by which rotation it turns within rotation_interval_s.
struct VelocityReport {
  Time time;
  int sensor = 0;
  Vec3 velocity_m_per_s{};
  Quaternion rotation{0, 0, 0, 1};
  double rotation_interval_s = 1;
};

/// How a sensor's velocity changes, and how its turning changes within rotation_interval_s.
struct AccelerationReport {
  Time time;
  int sensor = 0;
  Vec3 acceleration_m_per_s2{};
  Quaternion rotation{0, 0, 0, 1};
  double rotation_interval_s = 1;
};

/// A button went down or up.
struct ButtonReport {
  Time time;
  int button = 0;
  bool pressed = false;
};

/// The value of every analog channel.
struct AnalogReport {
  Time time;
  std::vector<double> channels;
};

/// The force written to the device.
struct ForceReport {
  Time time;
  Vec3 force_N{};
};

/// Depth of penetration: how far the device is inside what the proxy cannot enter.
struct DepthReport {
  Time time;
  double depth_m = 0;
};

/// The surface contact point (SCP) and the orientation of the stylus.
struct ContactPointReport {
  Time time;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};
};

/// Whether anything is touched.
struct TouchingReport {
  Time time;
  bool touching = false;
};

/// Which object is touched, -1 for none.
struct TouchedObjectReport {
  Time time;
  int object = -1;
};

/// Angle between the stylus axis and the surface normal, 0 without contact.
struct AngleReport {
  Time time;
  double angle_deg = 0;
  bool touching = false;
};

/// A limit of the device tripped, or it recovered.
struct ForceErrorReport {
  Time time;
  ForceError error = ForceError::recovered;
};

/// How much a text message matters; the numbers are VRPN's.
enum class Severity { normal = 0, warning = 1, error = 2 };

/// The server says something to a human.
struct TextReport {
  Time time;
  Severity severity = Severity::normal;
  std::string text;
};

/// Where the base of the tracker stands in the room; answers Client::requestToRoom().
struct ToRoomReport {
  Time time;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};
};

/// How the tracked unit is mounted on a sensor; answers Client::requestUnitToSensor().
struct UnitToSensorReport {
  Time time;
  int sensor = 0;
  Vec3 position_m{};
  Quaternion orientation{0, 0, 0, 1};
};

/// The box the tracker works in; answers Client::requestWorkspace().
struct WorkspaceReport {
  Time time;
  Vec3 min_m{};
  Vec3 max_m{};
};

/// One servo tick, whole; see Client::subscribe().
struct TickReport {
  Time time;
  std::uint64_t tick = 0;                ///< from 1, without gaps in the server
  std::chrono::nanoseconds tick_time{};  ///< on the server's monotonic clock
  std::uint64_t revision = 0;            ///< of the scene that was felt
  Vec3 hand_m{};
  Vec3 proxy_m{};
  Vec3 velocity_m_per_s{};
  Quaternion orientation{0, 0, 0, 1};
  Vec3 force_N{};
  double depth_m = 0;
  int object = -1;                 ///< the one that pushes hardest, -1 for none
  std::uint32_t buttons = 0;       ///< bit 0: button 0
  std::uint32_t guard_active = 0;  ///< bits as in GuardReport
  std::uint32_t guard_latched = 0;
};

/// Where one object is touched.
struct Contact {
  int object = -1;  ///< -1: a plane
  Vec3 point_m{};
  Vec3 normal{};   ///< of length 1, away from the surface
  Vec3 force_N{};  ///< on the hand; the object feels the opposite
};

/// Every contact of one servo tick; empty once when the last one ends. See Client::subscribe().
struct ContactsReport {
  Time time;
  std::uint64_t tick = 0;
  std::chrono::nanoseconds tick_time{};  ///< on the server's monotonic clock
  std::vector<Contact> contacts;
};

/// What holds the force back: which trips of the guard are active or latched (bits as the server's
/// docs/safety.md lists them), whether forces are armed, whether somebody stopped them.
struct GuardReport {
  Time time;
  std::uint32_t active = 0;
  std::uint32_t latched = 0;
  bool armed = false;
  bool stopped = false;
};

/// The connection came up, or was lost for the reason given.
struct ConnectionReport {
  Time time;
  bool connected = false;
  std::string reason;
};

/// Kinds of reports, for counting them.
enum class ReportKind {
  pose,
  velocity,
  acceleration,
  button,
  analog,
  force,
  depth,
  contactPoint,
  touching,
  touchedObject,
  angle,
  forceError,
  text,
  toRoom,
  unitToSensor,
  workspace,
  tick,
  contacts,
  guard
};
inline constexpr std::size_t kReportKinds = 19;

/// A short name for people, such as "contact point".
std::string_view nameOf(ReportKind kind) noexcept;
/// "value out of range", "duty cycle", ...
std::string_view nameOf(ForceError error) noexcept;
/// "normal", "warning" or "error".
std::string_view nameOf(Severity severity) noexcept;

/// The newest report of each kind; zero and at time zero until one came, as after the loss of the connection.
struct LatestReports {
  std::map<int, PoseReport> pose;          ///< by sensor
  std::map<int, VelocityReport> velocity;  ///< by sensor
  std::map<int, bool> pressed;             ///< by button
  AnalogReport analog;
  ForceReport force;
  DepthReport depth;
  ContactPointReport contact_point;
  TouchingReport touching;
  TouchedObjectReport touched_object;
  AngleReport angle;
  TickReport tick;
  ContactsReport contacts;
  GuardReport guard;
};

}  // namespace hapticd
