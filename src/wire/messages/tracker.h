// Messages of vrpn_Tracker: poses of sensors and of the tracker in its room. Metres, quaternions x y z w.
#pragma once

#include "wire/types.h"

namespace hapticd::wire {

struct TrackerPosQuat {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Pos_Quat", Direction::kToClient, Reliability::kLowLatency,
                                     Role::report, "Reports the pose of a sensor; the filler is ignored."};
  std::int32_t sensor = 0;
  std::int32_t filler = 0;
  F64x3 position{};
  F64x4 orientation{0, 0, 0, 1};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("sensor", m.sensor);
    v("filler", m.filler);
    v("position", m.position, "m");
    v("orientation", m.orientation);
  }
};

struct TrackerVelocity {
  static constexpr MessageInfo kInfo{
      "vrpn_Tracker Velocity", Direction::kToClient, Reliability::kLowLatency, Role::report,
      "Reports how fast a sensor moves and by which rotation it turns within an interval."};
  std::int32_t sensor = 0;
  std::int32_t filler = 0;
  F64x3 velocity{};
  F64x4 rotation{0, 0, 0, 1};
  double interval = 1.0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("sensor", m.sensor);
    v("filler", m.filler);
    v("velocity", m.velocity, "m/s");
    v("rotation", m.rotation);
    v("interval", m.interval, "s");
  }
};

struct TrackerAcceleration {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Acceleration", Direction::kToClient,
                                     Reliability::kLowLatency, Role::report,
                                     "Reports how a sensor's velocity changes and by which rotation its "
                                     "turning changes within an interval."};
  std::int32_t sensor = 0;
  std::int32_t filler = 0;
  F64x3 acceleration{};
  F64x4 rotation{0, 0, 0, 1};
  double interval = 1.0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("sensor", m.sensor);
    v("filler", m.filler);
    v("acceleration", m.acceleration, "m/s^2");
    v("rotation", m.rotation);
    v("interval", m.interval, "s");
  }
};

struct TrackerToRoom {
  static constexpr MessageInfo kInfo{"vrpn_Tracker To_Room", Direction::kToClient, Reliability::kReliable,
                                     Role::report, "Reports the pose of the tracker's base in the room."};
  F64x3 position{};
  F64x4 orientation{0, 0, 0, 1};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("position", m.position, "m");
    v("orientation", m.orientation);
  }
};

struct TrackerUnitToSensor {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Unit_To_Sensor", Direction::kToClient,
                                     Reliability::kReliable, Role::report,
                                     "Says how a tracked unit is mounted on its sensor, one message for each "
                                     "sensor; the filler is ignored."};
  std::int32_t sensor = 0;
  std::int32_t filler = 0;
  F64x3 position{};
  F64x4 orientation{0, 0, 0, 1};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("sensor", m.sensor);
    v("filler", m.filler);
    v("position", m.position, "m");
    v("orientation", m.orientation);
  }
};

struct TrackerWorkspace {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Workspace", Direction::kToClient, Reliability::kReliable,
                                     Role::report, "Reports the box in which the tracker works."};
  F64x3 min{};
  F64x3 max{};

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("min", m.min, "m");
    v("max", m.max, "m");
  }
};

struct TrackerRequestToRoom {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Request_Tracker_To_Room", Direction::kToServer,
                                     Reliability::kReliable, Role::control, "Asks for To_Room."};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct TrackerRequestUnitToSensor {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Request_Unit_To_Sensor", Direction::kToServer,
                                     Reliability::kReliable, Role::control,
                                     "Asks for one Unit_To_Sensor per sensor."};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct TrackerRequestWorkspace {
  static constexpr MessageInfo kInfo{"vrpn_Tracker Request_Tracker_Workspace", Direction::kToServer,
                                     Reliability::kReliable, Role::control, "Asks for Workspace."};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

struct TrackerSetUpdateRate {
  static constexpr MessageInfo kInfo{"vrpn_Tracker set_update_rate", Direction::kToServer,
                                     Reliability::kReliable, Role::control, "Asks for a report rate."};
  double rate = 0;

  template <class M, class V>
  static constexpr void fields(M& m, V&& v) {
    v("rate", m.rate, "Hz");
  }
};

struct TrackerResetOrigin {
  static constexpr MessageInfo kInfo{
      "vrpn_Tracker Reset_Origin",          Direction::kToServer, Reliability::kReliable, Role::control,
      "Makes the present pose the origin.", Access::command};
  template <class M, class V>
  static constexpr void fields(M&, V&&) {}
};

}  // namespace hapticd::wire
