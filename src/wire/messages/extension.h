// Messages that VRPN does not know. Peers learn names in the handshake and ignore unknown ones, so none of
// these disturbs a stock client or server. Their meaning: docs/wire-extensions.md.
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

/// Version of the extensions, in Capabilities.
inline constexpr std::int32_t kExtensionVersion = 1;

/// Bits of Capabilities::features.
enum Feature : std::uint32_t {
  kFeatureBulkMesh = 1U << 0,
  kFeatureBatch = 1U << 1,
  kFeatureSubscribe = 1U << 2,
  kFeatureStop = 1U << 3,
  kFeatureHeartbeat = 1U << 4,
  kFeatureHoldHand = 1U << 5,        ///< the device is simulated
  kFeatureRemoteContacts = 1U << 6,  ///< Remote_Contacts, Held_Force and Hand_State
};

/// Bits of Subscribe::kinds.
enum ReportKinds : std::uint32_t {
  kReportTracker = 1U << 0,        ///< Pos_Quat of sensor 0 (the proxy) and Velocity
  kReportForce = 1U << 1,          ///< Force, SCP, DOP, isTouching, TouchedObject, Angle
  kReportButton = 1U << 2,         ///< Change
  kReportAnalog = 1U << 3,         ///< Channel: the gripper's opening
  kReportTick = 1U << 4,           ///< hapticd Tick
  kReportContacts = 1U << 5,       ///< hapticd Contacts
  kReportHand = 1U << 6,           ///< hapticd Hand_State
  kReportContactPoint = 1U << 7,   ///< Pos_Quat of sensor 2, the surface contact point
  kReportTouchButton = 1U << 8,    ///< Change of the button after the device's own: touching
  kReportContactAnalog = 1U << 9,  ///< Channel: force, depth, angle, touched object, the gripper's opening
  kReportHip = 1U << 10,           ///< Pos_Quat and Velocity of sensor 1, the HIP
  kReportPoses = 1U << 11,         ///< hapticd Poses
  kReportDefault = kReportTracker | kReportForce | kReportButton | kReportAnalog,
  kReportAll = (1U << 12) - 1,
};

struct QueryCapabilities {
  static constexpr MessageInfo kInfo{
      "hapticd Query_Capabilities", Direction::kToServer, Reliability::kReliable, Role::control,
      "Asks for the abilities of the server and its device; answered by Capabilities."};

  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct Capabilities {
  static constexpr MessageInfo kInfo{
      "hapticd Capabilities", Direction::kToClient, Reliability::kReliable, Role::report,
      "Answers Query_Capabilities: version of the extensions, feature bits, facts of the device."};
  std::int32_t version = kExtensionVersion;
  std::uint32_t features = 0;
  double servoRate = 0;
  double reportRate = 0;
  double peakForce = 0;
  std::int32_t buttons = 0;
  std::array<double, 6> workspace{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("version", m.version);
    v("features", m.features);
    v("servo_rate", m.servoRate, "Hz");
    v("report_rate", m.reportRate, "Hz");
    v("peak_force", m.peakForce, "N");
    v("buttons", m.buttons);
    v("workspace", m.workspace, "m");
  }
};

struct MeshVertices {
  /// 5000 vertices: a message stays below the 64,000 bytes that VRPN's buffers hold.
  static constexpr std::size_t kMost = 5000;
  static constexpr MessageInfo kInfo{"hapticd Mesh_Vertices", Direction::kToServer, Reliability::kReliable,
                                     Role::scene,
                                     "Sets a run of vertices of an object from number first on: x y z each."};
  std::int32_t object = 0;
  std::int32_t first = 0;
  Counted<std::int32_t, float, 3 * kMost> positions;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("first", m.first);
    v("positions", m.positions, "world units");
  }
};

struct MeshTriangles {
  static constexpr std::size_t kMost = 5000;
  static constexpr MessageInfo kInfo{
      "hapticd Mesh_Triangles", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Sets a run of triangles of an object from number first on: three vertex numbers each."};
  std::int32_t object = 0;
  std::int32_t first = 0;
  Counted<std::int32_t, std::int32_t, 3 * kMost> vertices;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("first", m.first);
    v("vertices", m.vertices);
  }
};

struct BatchBegin {
  static constexpr MessageInfo kInfo{
      "hapticd Batch_Begin", Direction::kToServer, Reliability::kReliable, Role::scene,
      "Starts a batch: the client's commands until Batch_Commit become visible in one tick, or not at all."};

  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct BatchCommit {
  static constexpr MessageInfo kInfo{"hapticd Batch_Commit", Direction::kToServer, Reliability::kReliable,
                                     Role::scene, "Ends a batch and makes it visible."};

  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct Subscribe {
  static constexpr MessageInfo kInfo{
      "hapticd Subscribe", Direction::kToServer, Reliability::kReliable, Role::control,
      "Chooses which reports this client gets and how often; rate 0 keeps the rate as it is."};
  std::uint32_t kinds = kReportDefault;
  double rate = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("kinds", m.kinds);
    v("rate", m.rate, "Hz");
  }
};

/// All values of one tick. Positions in world units / 1000 in the world frame, as in the tracker reports.
struct TickReport {
  static constexpr MessageInfo kInfo{
      "hapticd Tick", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports one servo tick: its number, its time on the server's monotonic clock, and its values."};
  std::uint64_t tick = 0;
  std::int64_t time = 0;
  std::uint64_t revision = 0;
  F64x3 hand{};
  F64x3 proxy{};
  F64x3 velocity{};
  F64x4 orientation{0, 0, 0, 1};
  F64x3 force{};
  double depth = 0;
  std::int32_t object = -1;
  std::uint32_t buttons = 0;
  std::uint32_t guardActive = 0;
  std::uint32_t guardLatched = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("tick", m.tick);
    v("time", m.time, "ns");
    v("revision", m.revision);
    v("hand", m.hand, "m");
    v("proxy", m.proxy, "m");
    v("velocity", m.velocity, "m/s");
    v("orientation", m.orientation);
    v("force", m.force, "N");
    v("depth", m.depth, "m");
    v("object", m.object);
    v("buttons", m.buttons);
    v("guard_active", m.guardActive);
    v("guard_latched", m.guardLatched);
  }
};

struct ContactList {
  /// Numbers of one contact: object, point, normal, force on the hand.
  static constexpr std::size_t kNumbers = 10;
  static constexpr MessageInfo kInfo{
      "hapticd Contacts", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports every touched object of a tick: object, point, normal, force on the hand (10 numbers each)."};
  std::uint64_t tick = 0;
  std::int64_t time = 0;
  Counted<std::int32_t, double, 8 * kNumbers> contacts;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("tick", m.tick);
    v("time", m.time, "ns");
    v("contacts", m.contacts);
  }
};

struct StopForces {
  static constexpr MessageInfo kInfo{"hapticd Stop_Forces",
                                     Direction::kToServer,
                                     Reliability::kReliable,
                                     Role::control,
                                     "Brings the force to zero within one tick, until re-armed. Any client "
                                     "may.",
                                     Access::free,
                                     Order::overtaking};

  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct RearmForces {
  static constexpr MessageInfo kInfo{"hapticd Rearm_Forces",
                                     Direction::kToServer,
                                     Reliability::kReliable,
                                     Role::control,
                                     "Clears a stop and latched faults; forces return over 0.5 s.",
                                     Access::operate};

  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct GuardState {
  static constexpr MessageInfo kInfo{
      "hapticd Guard_State", Direction::kToClient, Reliability::kReliable, Role::report,
      "Reports, on change, which trips hold the force (bits) and whether it is armed or stopped."};
  std::uint32_t active = 0;
  std::uint32_t latched = 0;
  Bool16 armed = 0;
  Bool16 stopped = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("active", m.active);
    v("latched", m.latched);
    v("armed", m.armed);
    v("stopped", m.stopped);
  }
};

struct Heartbeat {
  static constexpr MessageInfo kInfo{
      "hapticd Heartbeat",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Starts a watchdog: a client that then sends none for 500 ms is lost; watch 0 ends it.",
      Access::free,
      Order::overtaking};
  Bool16 watch = 1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("watch", m.watch);
  }
};

struct HoldHand {
  static constexpr MessageInfo kInfo{
      "hapticd Hold_Hand",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Moves the simulated hand's target while hold is set; one client holds it at a time.",
      Access::operate};
  Bool16 hold = 0;
  F64x3 position{};
  F64x4 orientation{0, 0, 0, 1};
  std::uint32_t buttons = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("hold", m.hold);
    v("position", m.position, "world units");
    v("orientation", m.orientation);
    v("buttons", m.buttons);
  }
};

/// Shapes of a remote contact: the first number behind its id.
enum RemoteShape : std::uint32_t {
  kRemoteHalfSpace = 0,
  kRemoteSphere = 1,    ///< of a radius; the point is on its surface
  kRemoteCylinder = 2,  ///< of a radius, without ends; the point is on its surface
};

/// A client's own simulation around the tool. World frame, lengths in world units / 1000 as in the reports.
struct RemoteContacts {
  static constexpr std::size_t kMost = 16;
  /// Numbers of one contact, in this order: id, shape, radius (m; negative: touched from inside), point xyz
  /// (m), normal xyz, axis xyz (of a cylinder), velocity xyz of the surface at the point (m/s), angular
  /// velocity xyz (rad/s), stiffness (N/m), damping (N s/m), static and dynamic friction, lifetime (s),
  /// yields (0 or 1).
  static constexpr std::size_t kNumbers = 24;
  static constexpr MessageInfo kInfo{
      "hapticd Remote_Contacts",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Replaces the client's contacts near the hand, up to 16 (24 numbers each): felt until they expire.",
      Access::command,
      Order::overtaking};
  std::int64_t time = 0;       ///< on the client's clock; older messages than the newest are ignored
  std::int64_t stateTime = 0;  ///< `time` of the Hand_State that the contacts follow from; 0: none
  Counted<std::int32_t, double, kMost * kNumbers> contacts;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("time", m.time, "ns");
    v("state_time", m.stateTime, "ns");
    v("contacts", m.contacts);
  }
};

struct HeldForce {
  static constexpr MessageInfo kInfo{
      "hapticd Held_Force",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Sets a force that the server holds for its lifetime, within a budget of energy.",
      Access::command,
      Order::overtaking};
  std::int64_t time = 0;
  F64x3 force{};
  F64x3 torque{};
  double lifetime = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("time", m.time, "ns");
    v("force", m.force, "N");
    v("torque", m.torque, "N m");
    v("lifetime", m.lifetime, "s");
  }
};

/// Bits of HandState::flags.
enum HandFlags : std::uint32_t {
  kHandHasGripper = 1U << 0,
  kHandEnergySpent = 1U << 1,      ///< the part of the held force that adds power is cut
  kHandCorrectionsHeld = 1U << 2,  ///< a remote contact moved without a stated velocity and waits for energy
};

/// What a client that streams contacts or forces needs of a tick. Positions in world units / 1000 in the
/// world frame.
struct HandState {
  /// Numbers of one remote contact: id, proxy xyz (m), force on the hand xyz (N), depth (m).
  static constexpr std::size_t kNumbers = 8;
  static constexpr MessageInfo kInfo{
      "hapticd Hand_State", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports the newest tick: pose, velocity, buttons, force written, remote contacts (8 numbers each)."};
  std::uint64_t tick = 0;
  std::int64_t time = 0;
  std::int64_t contactsTime = 0;  ///< `time` of the newest Remote_Contacts that this tick knows, 0: none
  std::int64_t forceTime = 0;     ///< `time` of the newest Held_Force that this tick knows, 0: none
  F64x3 position{};
  F64x4 orientation{0, 0, 0, 1};
  F64x3 velocity{};
  F64x3 angularVelocity{};
  F64x3 force{};
  F64x3 heldForce{};
  double energy = 0;
  double gripper = 0;
  std::uint32_t buttons = 0;
  std::uint32_t flags = 0;
  std::uint32_t guardActive = 0;
  Counted<std::int32_t, double, RemoteContacts::kMost * kNumbers> contacts;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("tick", m.tick);
    v("time", m.time, "ns");
    v("contacts_time", m.contactsTime, "ns");
    v("force_time", m.forceTime, "ns");
    v("position", m.position, "m");
    v("orientation", m.orientation);
    v("velocity", m.velocity, "m/s");
    v("angular_velocity", m.angularVelocity, "rad/s");
    v("force", m.force, "N");
    v("held_force", m.heldForce, "N");
    v("energy", m.energy, "J");
    v("gripper", m.gripper, "rad");
    v("buttons", m.buttons);
    v("flags", m.flags);
    v("guard_active", m.guardActive);
    v("contacts", m.contacts);
  }
};

/// Who a connection belongs to. A token is a secret: it must not be logged or recorded.
struct Identify {
  static constexpr std::size_t kShortestToken = 16;
  static constexpr std::size_t kLongestToken = 128;
  static constexpr MessageInfo kInfo{
      "hapticd Identify",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Presents a token for a role, and a random key that the connections of one program share.",
      Access::free,
      Order::overtaking};
  NameBuffer<kLongestToken> token;  ///< empty: none
  std::uint64_t key = 0;            ///< a stop on one of them may be undone on another; 0: none

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("token", m.token);
    v("key", m.key);
  }
};

struct ReleaseControl {
  static constexpr MessageInfo kInfo{
      "hapticd Release_Control", Direction::kToServer, Reliability::kReliable, Role::control,
      "Gives up the control that `control = \"first\"` gave to this client, for the next one to command."};

  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

/// Where the objects that move are in a tick, so that a picture shows the force and its cause at one time.
/// World frame and units.
struct Poses {
  static constexpr std::size_t kMost = 256;
  /// Numbers of one object: id, then the columns x, y, z and the translation of the transform from its mesh
  /// to the world.
  static constexpr std::size_t kNumbers = 13;
  static constexpr MessageInfo kInfo{
      "hapticd Poses", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports the objects that move, until 1 s after they rest: 13 numbers each, up to 256 in one tick."};
  std::uint64_t tick = 0;
  std::int64_t time = 0;
  Counted<std::int32_t, double, kMost * kNumbers> poses;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("tick", m.tick);
    v("time", m.time, "ns");
    v("poses", m.poses);
  }
};

/// A name for people. It has no effect on forces.
struct SetObjectName {
  static constexpr MessageInfo kInfo{"hapticd Set_Object_Name", Direction::kToServer, Reliability::kReliable,
                                     Role::scene, "Names an object, for the viewer and for recordings."};
  std::int32_t object = 0;
  NameBuffer<64> text;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("object", m.object);
    v("text", m.text);
  }
};

/// Marks a moment of an experiment: written to the recording, and sent to all clients of the device.
struct Marker {
  static constexpr MessageInfo kInfo{
      "hapticd Marker", Direction::kBoth, Reliability::kReliable, Role::control,
      "Marks a moment, such as \"trial 3 begins\": recorded, and reported to all clients with its time."};
  std::int64_t time = 0;  ///< from the server: on its monotonic clock; to the server: ignored
  TextBuffer<256> text;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("time", m.time, "ns");
    v("text", m.text);
  }
};

/// Steers a server that replays a recording; all of its clients see the same.
struct ReplayControl {
  static constexpr MessageInfo kInfo{
      "hapticd Replay_Control", Direction::kToServer, Reliability::kReliable, Role::control,
      "Pauses a replayed recording, changes its speed (0 keeps it), or seeks (a negative time does not)."};
  Bool16 paused = 0;
  double speed = 0;
  double position = -1;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("paused", m.paused);
    v("speed", m.speed);
    v("position", m.position, "s");
  }
};

/// Begins and ends a recording on the server's disk.
struct RecordingControl {
  static constexpr MessageInfo kInfo{
      "hapticd Recording_Control",
      Direction::kToServer,
      Reliability::kReliable,
      Role::control,
      "Begins or ends a recording on the server, in a file of this name; answered by a text.",
      Access::operate};
  Bool16 record = 0;
  /// *.haptics, without a folder. Empty: a beginning is named by the time, and an end is that of whichever
  /// recording is written; with a name, of no other.
  NameBuffer<128> name;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("record", m.record);
    v("name", m.name);
  }
};

}  // namespace hapticd::wire
