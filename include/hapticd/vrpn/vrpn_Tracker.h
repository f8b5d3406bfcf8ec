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

class VRPN_API vrpn_Tracker : public vrpn_BaseClass {
 public:
  vrpn_Tracker(const char* name, vrpn_Connection* connection = NULL) : vrpn_BaseClass(name, connection) {}
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
