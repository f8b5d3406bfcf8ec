// A device program as people write it for VRPN: one device made of all server classes. It compiles with
// VRPN's own headers, too; testdata/vrpn_server has what it said when it was linked with VRPN.
#pragma once

#include <stdio.h>
#include <vrpn_Analog.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_ForceDeviceServer.h>
#include <vrpn_Text.h>
#include <vrpn_Tracker.h>

/// Answers each command with a text of its arguments, so that the conversation shows what arrived.
class SpokenForceDevice : public vrpn_ForceDeviceServer {
 public:
  SpokenForceDevice(const char* name, vrpn_Connection* connection)
      : vrpn_ForceDeviceServer(name, connection) {
    register_autodeleted_handler(forcefield_message_id, onField, this, d_sender_id);
    register_autodeleted_handler(plane_message_id, onPlane, this, d_sender_id);
    register_autodeleted_handler(plane_effects_message_id, onPlaneEffects, this, d_sender_id);
    register_autodeleted_handler(custom_effect_message_id, onEffect, this, d_sender_id);
  }
  void mainloop() { server_mainloop(); }

  void report(const timeval& now) {
    const vrpn_float64 force_N[3] = {1, -2, 0.5};
    const vrpn_float64 position[3] = {0.01, 0.02, 0.03};
    const vrpn_float64 quaternion[4] = {0, 0, 0.6, 0.8};
    vrpn_int32 length = 0;
    char* payload = encode_force(length, force_N);
    d_connection->pack_message(length, now, force_message_id, d_sender_id, payload,
                               vrpn_CONNECTION_LOW_LATENCY);
    delete[] payload;
    payload = encode_scp(length, position, quaternion);
    d_connection->pack_message(length, now, scp_message_id, d_sender_id, payload,
                               vrpn_CONNECTION_LOW_LATENCY);
    delete[] payload;
    sendError(FD_DUTY_CYCLE_ERROR);
  }

 private:
  template <class... T>
  bool say(const char* format, T... values) {
    char text[400];
    snprintf(text, sizeof text, format, values...);
    send_text_message(vrpn_TEXT_NORMAL)(text);
    return true;
  }
  virtual bool addObject(vrpn_int32 o, vrpn_int32 parent) { return say("addObject %d %d", o, parent); }
  virtual bool addObjectExScene(vrpn_int32 o) { return say("addObjectExScene %d", o); }
  virtual bool setVertex(vrpn_int32 o, vrpn_int32 v, vrpn_float32 x, vrpn_float32 y, vrpn_float32 z) {
    return say("setVertex %d %d %g %g %g", o, v, double(x), double(y), double(z));
  }
  virtual bool setNormal(vrpn_int32 o, vrpn_int32 n, vrpn_float32 x, vrpn_float32 y, vrpn_float32 z) {
    return say("setNormal %d %d %g %g %g", o, n, double(x), double(y), double(z));
  }
  virtual bool setTriangle(vrpn_int32 o, vrpn_int32 t, vrpn_int32 a, vrpn_int32 b, vrpn_int32 c, vrpn_int32 d,
                           vrpn_int32 e, vrpn_int32 f) {
    return say("setTriangle %d %d %d %d %d %d %d %d", o, t, a, b, c, d, e, f);
  }
  virtual bool removeTriangle(vrpn_int32 o, vrpn_int32 t) { return say("removeTriangle %d %d", o, t); }
  virtual bool updateTrimeshChanges(vrpn_int32 o, vrpn_float32 k, vrpn_float32 d, vrpn_float32 fd,
                                    vrpn_float32 fs) {
    return say("updateTrimeshChanges %d %g %g %g %g", o, double(k), double(d), double(fd), double(fs));
  }
  virtual bool setTrimeshType(vrpn_int32 o, vrpn_int32 type) { return say("setTrimeshType %d %d", o, type); }
  virtual bool setTrimeshTransform(vrpn_int32 o, vrpn_float32 m[16]) {
    return say("setTrimeshTransform %d %g %g %g", o, double(m[0]), double(m[3]), double(m[15]));
  }
  virtual bool setObjectPosition(vrpn_int32 o, vrpn_float32 p[3]) {
    return say("setObjectPosition %d %g %g %g", o, double(p[0]), double(p[1]), double(p[2]));
  }
  virtual bool setObjectOrientation(vrpn_int32 o, vrpn_float32 axis[3], vrpn_float32 angle) {
    return say("setObjectOrientation %d %g %g %g %g", o, double(axis[0]), double(axis[1]), double(axis[2]),
               double(angle));
  }
  virtual bool setObjectScale(vrpn_int32 o, vrpn_float32 s[3]) {
    return say("setObjectScale %d %g %g %g", o, double(s[0]), double(s[1]), double(s[2]));
  }
  virtual bool removeObject(vrpn_int32 o) { return say("removeObject %d", o); }
  virtual bool clearTrimesh(vrpn_int32 o) { return say("clearTrimesh %d", o); }
  virtual bool moveToParent(vrpn_int32 o, vrpn_int32 parent) { return say("moveToParent %d %d", o, parent); }
  virtual bool setHapticOrigin(vrpn_float32 p[3], vrpn_float32 axis[3], vrpn_float32 angle) {
    return say("setHapticOrigin %g %g %g", double(p[0]), double(axis[1]), double(angle));
  }
  virtual bool setHapticScale(vrpn_float32 s) { return say("setHapticScale %g", double(s)); }
  virtual bool setSceneOrigin(vrpn_float32 p[3], vrpn_float32 axis[3], vrpn_float32 angle) {
    return say("setSceneOrigin %g %g %g", double(p[0]), double(axis[1]), double(angle));
  }
  virtual bool setObjectIsTouchable(vrpn_int32 o, vrpn_bool t) {
    return say("setObjectIsTouchable %d %d", o, int(t));
  }

  static int VRPN_CALLBACK onField(void* self, vrpn_HANDLERPARAM p) {
    vrpn_float32 origin[3], force[3], jacobian[3][3], radius;
    if (decode_forcefield(p.buffer, p.payload_len, origin, force, jacobian, &radius) != 0) return -1;
    static_cast<SpokenForceDevice*>(self)->say("field %g %g %g %g", double(origin[0]), double(force[1]),
                                               double(jacobian[2][1]), double(radius));
    return 0;
  }
  static int VRPN_CALLBACK onPlane(void* self, vrpn_HANDLERPARAM p) {
    vrpn_float32 plane[4], k, d, fd, fs;
    vrpn_int32 index, cycles;
    if (decode_plane(p.buffer, p.payload_len, plane, &k, &d, &fd, &fs, &index, &cycles) != 0) return -1;
    static_cast<SpokenForceDevice*>(self)->say("plane %g %g %g %g %g %g %d %d", double(plane[1]),
                                               double(plane[3]), double(k), double(d), double(fd), double(fs),
                                               index, cycles);
    return 0;
  }
  static int VRPN_CALLBACK onPlaneEffects(void* self, vrpn_HANDLERPARAM p) {
    vrpn_float32 v[6];
    if (decode_surface_effects(p.buffer, p.payload_len, v, v + 1, v + 2, v + 3, v + 4, v + 5) != 0) return -1;
    static_cast<SpokenForceDevice*>(self)->say("plane2 %g %g %g %g %g %g", double(v[0]), double(v[1]),
                                               double(v[2]), double(v[3]), double(v[4]), double(v[5]));
    return 0;
  }
  static int VRPN_CALLBACK onEffect(void* self, vrpn_HANDLERPARAM p) {
    vrpn_uint32 effect = 0, count = 0;
    vrpn_float32* values = NULL;
    if (decode_custom_effect(p.buffer, p.payload_len, &effect, &values, &count) != 0) return -1;
    static_cast<SpokenForceDevice*>(self)->say("effect %u %u %g", effect, count,
                                               count > 0 ? double(values[0]) : 0.0);
    delete[] values;
    return 0;
  }
};

/// Reports everything once, when a client has reset the tracker's origin.
class DeviceProgram {
 public:
  explicit DeviceProgram(vrpn_Connection* connection)
      : connection_(connection),
        tracker_("Device0", connection, 2),
        button_("Device0", connection, 3),
        analog_("Device0", connection, 4),
        text_("Device0", connection),
        force_("Device0", connection) {
    connection->register_handler(connection->register_message_type("vrpn_Tracker Reset_Origin"), onReset,
                                 this);
    button_.set_alerts(1);
  }
  ~DeviceProgram() {
    connection_->unregister_handler(connection_->register_message_type("vrpn_Tracker Reset_Origin"), onReset,
                                    this);
  }

  void mainloop() {
    tracker_.mainloop();
    button_.mainloop();
    analog_.mainloop();
    text_.mainloop();
    force_.mainloop();
    connection_->mainloop();
  }

 private:
  static int VRPN_CALLBACK onReset(void* self, vrpn_HANDLERPARAM) {
    static_cast<DeviceProgram*>(self)->report();
    return 0;
  }
  void report() {
    struct timeval now;
    vrpn_gettimeofday(&now, NULL);
    const vrpn_float64 position[3] = {1, 2, 3};
    const vrpn_float64 quaternion[4] = {0, 0.6, 0, 0.8};
    tracker_.report_pose(1, now, position, quaternion);
    tracker_.report_pose_velocity(0, now, position, quaternion, 0.25);
    tracker_.report_pose_acceleration(1, now, position, quaternion, 0.5);
    button_.set_button(0, 1);
    button_.set_button(2, 1);
    button_.mainloop();
    button_.set_button(0, 0);
    button_.set_button(2, 0);
    button_.mainloop();
    for (int i = 0; i < 4; ++i) analog_.channels()[i] = 0.5 * i;
    analog_.report_changes();
    analog_.report_changes();
    analog_.report();
    text_.send_message("all is reported", vrpn_TEXT_WARNING, 7);
    force_.report(now);
  }

  vrpn_Connection* connection_;
  vrpn_Tracker_Server tracker_;
  vrpn_Button_Server button_;
  vrpn_Analog_Server analog_;
  vrpn_Text_Sender text_;
  SpokenForceDevice force_;
};
