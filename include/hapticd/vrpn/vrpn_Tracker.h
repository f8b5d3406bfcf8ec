// Poses of the sensors of a device.
#ifndef vrpn_TRACKER_H
#define vrpn_TRACKER_H

#include <map>

#include "vrpn_BaseClass.h"

const int vrpn_ALL_SENSORS = -1;

// States of a tracker's driver.
const int vrpn_TRACKER_SYNCING = 3;
const int vrpn_TRACKER_AWAITING_STATION = 2;
const int vrpn_TRACKER_REPORT_READY = 1;
const int vrpn_TRACKER_PARTIAL = 0;
const int vrpn_TRACKER_RESETTING = -1;
const int vrpn_TRACKER_FAIL = -2;

typedef vrpn_float64 vrpn_Tracker_Pos[3];
typedef vrpn_float64 vrpn_Tracker_Quat[4];

typedef struct _vrpn_TRACKERCB {
  struct timeval msg_time;
  vrpn_int32 sensor;
  vrpn_float64 pos[3];
  vrpn_float64 quat[4];
} vrpn_TRACKERCB;
typedef void(VRPN_CALLBACK* vrpn_TRACKERCHANGEHANDLER)(void* userdata, const vrpn_TRACKERCB info);

typedef struct _vrpn_TRACKERVELCB {
  struct timeval msg_time;
  vrpn_int32 sensor;
  vrpn_float64 vel[3];
  vrpn_float64 vel_quat[4];
  vrpn_float64 vel_quat_dt;
} vrpn_TRACKERVELCB;
typedef void(VRPN_CALLBACK* vrpn_TRACKERVELCHANGEHANDLER)(void* userdata, const vrpn_TRACKERVELCB info);

typedef struct _vrpn_TRACKERACCCB {
  struct timeval msg_time;
  vrpn_int32 sensor;
  vrpn_float64 acc[3];
  vrpn_float64 acc_quat[4];
  vrpn_float64 acc_quat_dt;
} vrpn_TRACKERACCCB;
typedef void(VRPN_CALLBACK* vrpn_TRACKERACCCHANGEHANDLER)(void* userdata, const vrpn_TRACKERACCCB info);

typedef struct _vrpn_TRACKERTRACKER2ROOMCB {
  struct timeval msg_time;
  vrpn_float64 tracker2room[3];
  vrpn_float64 tracker2room_quat[4];
} vrpn_TRACKERTRACKER2ROOMCB;
typedef void(VRPN_CALLBACK* vrpn_TRACKERTRACKER2ROOMCHANGEHANDLER)(void* userdata,
                                                                   const vrpn_TRACKERTRACKER2ROOMCB info);

typedef struct _vrpn_TRACKERUNIT2SENSORCB {
  struct timeval msg_time;
  vrpn_int32 sensor;
  vrpn_float64 unit2sensor[3];
  vrpn_float64 unit2sensor_quat[4];
} vrpn_TRACKERUNIT2SENSORCB;
typedef void(VRPN_CALLBACK* vrpn_TRACKERUNIT2SENSORCHANGEHANDLER)(void* userdata,
                                                                  const vrpn_TRACKERUNIT2SENSORCB info);

typedef struct _vrpn_TRACKERWORKSPACECB {
  struct timeval msg_time;
  vrpn_float64 workspace_min[3];
  vrpn_float64 workspace_max[3];
} vrpn_TRACKERWORKSPACECB;
typedef void(VRPN_CALLBACK* vrpn_TRACKERWORKSPACECHANGEHANDLER)(void* userdata,
                                                                const vrpn_TRACKERWORKSPACECB info);

/// What client and server of a tracker have in common: the state of one report, and how it is encoded.
/// Metres, quaternions x y z w. Configuration files are not read;
/// transforms and workspace start with the values of VRPN's default build, those of a desktop haptic device.
class VRPN_API vrpn_Tracker : public vrpn_BaseClass {
 public:
  vrpn_Tracker(const char* name, vrpn_Connection* connection = NULL, const char* configuration = NULL);

  void print_latest_report();
  /// For servers: answers the requests of the transforms and of the workspace.
  int register_server_handlers();
  void get_local_t2r(vrpn_float64* position, vrpn_float64* quaternion);
  void get_local_u2s(vrpn_int32 sensor, vrpn_float64* position, vrpn_float64* quaternion);
  static int VRPN_CALLBACK handle_t2r_request(void* tracker, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handle_u2s_request(void* tracker, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handle_workspace_request(void* tracker, vrpn_HANDLERPARAM p);

 protected:
  struct Pose {
    Pose() : position(), quaternion() { quaternion[3] = 1; }
    vrpn_Tracker_Pos position;
    vrpn_Tracker_Quat quaternion;
  };

  virtual int register_types();
  // Write a payload to a buffer of at least 100 bytes; return its size.
  virtual int encode_to(char* buffer);
  virtual int encode_vel_to(char* buffer);
  virtual int encode_acc_to(char* buffer);
  virtual int encode_tracker2room_to(char* buffer);
  virtual int encode_unit2sensor_to(char* buffer);
  virtual int encode_workspace_to(char* buffer);
  bool ensure_enough_unit2sensors(unsigned number);

  vrpn_int32 position_m_id = -1;
  vrpn_int32 velocity_m_id = -1;
  vrpn_int32 accel_m_id = -1;
  vrpn_int32 tracker2room_m_id = -1;
  vrpn_int32 unit2sensor_m_id = -1;
  vrpn_int32 workspace_m_id = -1;
  vrpn_int32 request_t2r_m_id = -1;
  vrpn_int32 request_u2s_m_id = -1;
  vrpn_int32 request_workspace_m_id = -1;
  vrpn_int32 update_rate_id = -1;
  vrpn_int32 reset_origin_m_id = -1;
  vrpn_int32 connection_dropped_m_id = -1;

  vrpn_int32 d_sensor = 0;
  vrpn_float64 pos[3] = {};
  vrpn_float64 d_quat[4] = {0, 0, 0, 1};
  vrpn_float64 vel[3] = {};
  vrpn_float64 vel_quat[4] = {0, 0, 0, 1};
  vrpn_float64 vel_quat_dt = 1;  // s
  vrpn_float64 acc[3] = {};
  vrpn_float64 acc_quat[4] = {0, 0, 0, 1};
  vrpn_float64 acc_quat_dt = 1;  // s
  struct timeval timestamp = {};
  struct timeval watchdog_timestamp = {};
  vrpn_int32 frame_count = 0;
  vrpn_float64 tracker2room[3] = {0, 0, -0.28};
  vrpn_float64 tracker2room_quat[4] = {0, 0, 0, 1};
  vrpn_int32 num_sensors = 1;
  std::vector<Pose> unit2sensors_;
  vrpn_float64 workspace_min[3] = {-0.2, -0.2, -0.1};
  vrpn_float64 workspace_max[3] = {0.2, 0.2, 0.2};
  int status = vrpn_TRACKER_SYNCING;
};

/// Serves poses that the program reports.
class VRPN_API vrpn_Tracker_Server : public vrpn_Tracker {
 public:
  vrpn_Tracker_Server(const char* name, vrpn_Connection* connection, vrpn_int32 sensors = 1);

  virtual void mainloop() { server_mainloop(); }
  /// -1 for a sensor that the tracker does not have, or without a connection.
  virtual int report_pose(int sensor, struct timeval time, const vrpn_float64 position[3],
                          const vrpn_float64 quaternion[4],
                          vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY);
  virtual int report_pose_velocity(int sensor, struct timeval time, const vrpn_float64 velocity[3],
                                   const vrpn_float64 quaternion[4], vrpn_float64 interval_s,
                                   vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY);
  virtual int report_pose_acceleration(int sensor, struct timeval time, const vrpn_float64 acceleration[3],
                                       const vrpn_float64 quaternion[4], vrpn_float64 interval_s,
                                       vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY);

 private:
  int report(int sensor, const struct timeval& time, vrpn_int32 type, int (vrpn_Tracker::*encode)(char*),
             vrpn_uint32 class_of_service);
};

class vrpn_RedundantTransmission;

/// Serves the identity pose, zero velocity and zero acceleration of each sensor at a rate.
class VRPN_API vrpn_Tracker_NULL : public vrpn_Tracker_Server {
 public:
  vrpn_Tracker_NULL(const char* name, vrpn_Connection* connection, vrpn_int32 sensors = 1,
                    vrpn_float64 rate_Hz = 1.0);
  virtual void mainloop();
  /// Not used: every report is sent once.
  void setRedundantTransmission(vrpn_RedundantTransmission*) {}

 protected:
  vrpn_float64 update_rate;  // Hz
};

class VRPN_API vrpn_Tracker_Remote : public vrpn_Tracker {
 public:
  vrpn_Tracker_Remote(const char* name, vrpn_Connection* connection = NULL);

  virtual void mainloop() { client_mainloop(); }
  int request_t2r_xform();
  int request_u2s_xform();
  int request_workspace();
  int set_update_rate(vrpn_float64 rate_Hz);
  int reset_origin();

#define HAPTICD_VRPN_SENSOR_HANDLERS(HANDLER, member)                                                    \
  virtual int register_change_handler(void* userdata, HANDLER handler,                                   \
                                      vrpn_int32 sensor = vrpn_ALL_SENSORS) {                            \
    return sensor < vrpn_ALL_SENSORS ? -1 : sensors_[sensor].member.register_handler(userdata, handler); \
  }                                                                                                      \
  virtual int unregister_change_handler(void* userdata, HANDLER handler,                                 \
                                        vrpn_int32 sensor = vrpn_ALL_SENSORS) {                          \
    return sensors_[sensor].member.unregister_handler(userdata, handler);                                \
  }
  HAPTICD_VRPN_SENSOR_HANDLERS(vrpn_TRACKERCHANGEHANDLER, poses)
  HAPTICD_VRPN_SENSOR_HANDLERS(vrpn_TRACKERVELCHANGEHANDLER, velocities)
  HAPTICD_VRPN_SENSOR_HANDLERS(vrpn_TRACKERACCCHANGEHANDLER, accelerations)
  HAPTICD_VRPN_SENSOR_HANDLERS(vrpn_TRACKERUNIT2SENSORCHANGEHANDLER, mounts)
#undef HAPTICD_VRPN_SENSOR_HANDLERS

  virtual int register_change_handler(void* userdata, vrpn_TRACKERTRACKER2ROOMCHANGEHANDLER handler) {
    return rooms_.register_handler(userdata, handler);
  }
  virtual int unregister_change_handler(void* userdata, vrpn_TRACKERTRACKER2ROOMCHANGEHANDLER handler) {
    return rooms_.unregister_handler(userdata, handler);
  }
  virtual int register_change_handler(void* userdata, vrpn_TRACKERWORKSPACECHANGEHANDLER handler) {
    return workspaces_.register_handler(userdata, handler);
  }
  virtual int unregister_change_handler(void* userdata, vrpn_TRACKERWORKSPACECHANGEHANDLER handler) {
    return workspaces_.unregister_handler(userdata, handler);
  }

 private:
  struct Sensor {
    vrpn_Callback_List<vrpn_TRACKERCB> poses;
    vrpn_Callback_List<vrpn_TRACKERVELCB> velocities;
    vrpn_Callback_List<vrpn_TRACKERACCCB> accelerations;
    vrpn_Callback_List<vrpn_TRACKERUNIT2SENSORCB> mounts;
  };
  template <class Report>
  void callSensor(vrpn_Callback_List<Report> Sensor::*list, const Report& report);
  static int VRPN_CALLBACK handlePose(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleVelocity(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleAcceleration(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleRoom(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleMount(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleWorkspace(void* self, vrpn_HANDLERPARAM p);

  std::map<vrpn_int32, Sensor> sensors_;  // vrpn_ALL_SENSORS is one
  vrpn_Callback_List<vrpn_TRACKERTRACKER2ROOMCB> rooms_;
  vrpn_Callback_List<vrpn_TRACKERWORKSPACECB> workspaces_;
};

#endif
