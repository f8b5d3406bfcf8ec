// Requests of poses, for devices that can move.
#ifndef VRPN_POSER_H
#define VRPN_POSER_H

#include "vrpn_BaseClass.h"

class vrpn_Poser : public vrpn_BaseClass {
 public:
  vrpn_Poser(const char* name, vrpn_Connection* connection = NULL) : vrpn_BaseClass(name, connection) {}
};

/// Asks a device of another VRPN server for poses (metres, quaternions x y z w) and velocities. Each request
/// returns 1, or 0 when it could not be sent.
class vrpn_Poser_Remote : public vrpn_Poser {
 public:
  vrpn_Poser_Remote(const char* name, vrpn_Connection* connection = NULL) : vrpn_Poser(name, connection) {}

  virtual void mainloop() { client_mainloop(); }
  int request_pose(const struct timeval t, const vrpn_float64 position[3], const vrpn_float64 quaternion[4]) {
    return request("vrpn_Poser Request Pos_Quat", t, position, quaternion, NULL);
  }
  int request_pose_relative(const struct timeval t, const vrpn_float64 position_delta[3],
                            const vrpn_float64 quaternion[4]) {
    return request("vrpn_Poser Request Relative Pos_Quat", t, position_delta, quaternion, NULL);
  }
  int request_pose_velocity(const struct timeval t, const vrpn_float64 velocity[3],
                            const vrpn_float64 quaternion[4], const vrpn_float64 interval) {
    return request("vrpn_Poser Request Velocity", t, velocity, quaternion, &interval);
  }
  int request_pose_velocity_relative(const struct timeval t, const vrpn_float64 velocity_delta[3],
                                     const vrpn_float64 quaternion[4], const vrpn_float64 interval_delta) {
    return request("vrpn_Poser Request Relative Velocity", t, velocity_delta, quaternion, &interval_delta);
  }

 private:
  int request(const char* type, const struct timeval& t, const vrpn_float64* vector,
              const vrpn_float64* quaternion, const vrpn_float64* interval) {
    if (d_connection == NULL) return 0;
    char payload[8 * sizeof(vrpn_float64)];
    char* at = payload;
    vrpn_int32 left = sizeof payload;
    for (int i = 0; i < 3; ++i) vrpn_buffer(&at, &left, vector[i]);
    for (int i = 0; i < 4; ++i) vrpn_buffer(&at, &left, quaternion[i]);
    if (interval != NULL) vrpn_buffer(&at, &left, *interval);
    return d_connection->pack_message(static_cast<vrpn_uint32>(at - payload), t,
                                      d_connection->register_message_type(type), d_sender_id, payload,
                                      vrpn_CONNECTION_LOW_LATENCY) == 0;
  }
};

#endif
