// A client program as people write it for VRPN: all remotes of one device. It compiles with VRPN's own
// headers, too; testdata/vrpn_server has what it said and what it was told when it was linked with VRPN.
#pragma once

#include <stdio.h>
#include <vrpn_Analog.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_ForceDevice.h>
#include <vrpn_Text.h>
#include <vrpn_Tracker.h>

#include <string>

/// Sends every command of a scene, then asks for all reports; what its handlers are told is one line each.
class DeviceUser {
 public:
  explicit DeviceUser(vrpn_Connection* connection)
      : tracker_("Device0", connection),
        button_("Device0", connection),
        analog_("Device0", connection),
        text_("Device0", connection),
        force_("Device0", connection) {
    tracker_.register_change_handler(this, onPose);
    tracker_.register_change_handler(this, onVelocity);
    tracker_.register_change_handler(this, onAcceleration);
    tracker_.register_change_handler(this, onTrackerToRoom);
    tracker_.register_change_handler(this, onWorkspace);
    button_.register_change_handler(this, onButton);
    button_.register_states_handler(this, onStates);
    analog_.register_change_handler(this, onAnalog);
    text_.register_message_handler(this, onText);
    force_.register_force_change_handler(this, onForce);
    force_.register_scp_change_handler(this, onContactPoint);
    force_.register_error_handler(this, onError);
  }

  void mainloop() {
    tracker_.mainloop();
    button_.mainloop();
    analog_.mainloop();
    text_.mainloop();
    force_.mainloop();
  }
  /// The device's last report has arrived.
  bool done() const { return done_; }
  const std::string& seen() const { return seen_; }

  void act() {
    vrpn_float32 three[3] = {1, 2, 3};
    vrpn_float32 force[3] = {4, 5, 6};
    vrpn_float32 up[3] = {0, 1, 0};
    vrpn_float32 matrix[16] = {1, 0, 0, 0, 5, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1};
    vrpn_float32 jacobian[3][3] = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
    vrpn_float32 parameters[2] = {8, 9};
    tracker_.request_t2r_xform();
    tracker_.request_u2s_xform();
    tracker_.request_workspace();
    button_.set_toggle(2, vrpn_BUTTON_TOGGLE_OFF);
    button_.set_momentary(1);

    force_.addObject(1);
    force_.addObject(2, 1);
    force_.addObjectExScene(3);
    force_.setVertex(3, -1, -2, -3);
    force_.setObjectVertex(1, 4, 1, 2, 3);
    force_.setObjectNormal(1, 5, 0, 1, 0);
    force_.setObjectTriangle(1, 6, 0, 1, 2);
    force_.setObjectTriangle(1, 7, 0, 1, 2, 3, 4, 5);
    force_.removeObjectTriangle(1, 6);
    force_.setSurfaceKspring(0.5f);
    force_.setSurfaceKdamping(0.25f);
    force_.setSurfaceFstatic(0.75f);
    force_.setSurfaceFdynamic(0.125f);
    force_.updateObjectTrimeshChanges(1);
    force_.useGhost();
    force_.setObjectTrimeshTransform(1, matrix);
    force_.setObjectPosition(1, three);
    force_.setObjectOrientation(1, up, 0.5f);
    force_.setObjectScale(1, three);
    force_.moveToParent(2, 3);
    force_.setHapticOrigin(three, up, 0.5f);
    force_.setSceneOrigin(three, up, 1.5f);
    force_.setHapticScale(2);
    force_.setObjectIsTouchable(1, false);
    force_.clearObjectTrimesh(1);
    force_.removeObject(1);

    force_.set_plane(0, 1, 0, -2);
    force_.setRecoveryTime(5);
    force_.startSurface();
    force_.sendSurface();
    force_.stopSurface();
    force_.setFF_Origin(three);
    force_.setFF_Force(force);
    force_.setFF_Jacobian(0, 0, 1, 0, 2, 0, 3, 0, 0);
    force_.setFF_Radius(0.25f);
    force_.sendForceField();
    force_.sendForceField(three, force, jacobian, 0.5f);
    force_.stopForceField();
    force_.setConstraintKSpring(100);
    force_.setConstraintPoint(three);
    force_.setConstraintMode(vrpn_ForceDevice::POINT_CONSTRAINT);
    force_.enableConstraint(1);
    force_.setConstraintLinePoint(three);
    force_.setConstraintLineDirection(up);
    force_.setConstraintMode(vrpn_ForceDevice::LINE_CONSTRAINT);
    force_.setConstraintPlanePoint(force);
    force_.setConstraintPlaneNormal(up);
    force_.setConstraintMode(vrpn_ForceDevice::PLANE_CONSTRAINT);
    force_.setConstraintKSpring(50);
    force_.enableConstraint(0);
    force_.setCustomEffect(3, parameters, 2);
    force_.startEffect();
    force_.stopEffect();
    tracker_.reset_origin();
  }

 private:
  template <class... T>
  void note(const char* format, T... values) {
    char line[400];
    snprintf(line, sizeof line, format, values...);
    seen_ += std::string(line) + '\n';
  }
  void notePose(const char* what, vrpn_int32 sensor, const vrpn_float64* p, const vrpn_float64* q) {
    note("%s %d %g %g %g %g %g %g %g", what, sensor, p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
  }
  static DeviceUser& of(void* self) { return *static_cast<DeviceUser*>(self); }

  static void VRPN_CALLBACK onPose(void* self, const vrpn_TRACKERCB r) {
    of(self).notePose("pose", r.sensor, r.pos, r.quat);
  }
  static void VRPN_CALLBACK onVelocity(void* self, const vrpn_TRACKERVELCB r) {
    of(self).notePose("velocity", r.sensor, r.vel, r.vel_quat);
    of(self).note("in %g", r.vel_quat_dt);
  }
  static void VRPN_CALLBACK onAcceleration(void* self, const vrpn_TRACKERACCCB r) {
    of(self).notePose("acceleration", r.sensor, r.acc, r.acc_quat);
    of(self).note("in %g", r.acc_quat_dt);
  }
  static void VRPN_CALLBACK onTrackerToRoom(void* self, const vrpn_TRACKERTRACKER2ROOMCB r) {
    of(self).notePose("room", 0, r.tracker2room, r.tracker2room_quat);
  }
  static void VRPN_CALLBACK onWorkspace(void* self, const vrpn_TRACKERWORKSPACECB r) {
    of(self).note("workspace %g %g %g %g %g %g", r.workspace_min[0], r.workspace_min[1], r.workspace_min[2],
                  r.workspace_max[0], r.workspace_max[1], r.workspace_max[2]);
  }
  static void VRPN_CALLBACK onButton(void* self, const vrpn_BUTTONCB r) {
    of(self).note("button %d %d", r.button, r.state);
  }
  static void VRPN_CALLBACK onStates(void* self, const vrpn_BUTTONSTATESCB r) {
    of(self).note("states %d: %d %d %d", r.num_buttons, r.states[0], r.states[1], r.states[2]);
  }
  static void VRPN_CALLBACK onAnalog(void* self, const vrpn_ANALOGCB r) {
    of(self).note("analog %d: %g %g %g %g", r.num_channel, r.channel[0], r.channel[1], r.channel[2],
                  r.channel[3]);
  }
  static void VRPN_CALLBACK onText(void* self, const vrpn_TEXTCB r) {
    of(self).note("text %d %u %s", static_cast<int>(r.type), r.level, r.message);
  }
  static void VRPN_CALLBACK onForce(void* self, const vrpn_FORCECB r) {
    of(self).note("force %g %g %g", r.force[0], r.force[1], r.force[2]);
  }
  static void VRPN_CALLBACK onContactPoint(void* self, const vrpn_FORCESCPCB r) {
    of(self).notePose("contact point", 0, r.pos, r.quat);
  }
  static void VRPN_CALLBACK onError(void* self, const vrpn_FORCEERRORCB r) {
    of(self).note("error %d", r.error_code);
    of(self).done_ = true;  // the device's last report
  }

  vrpn_Tracker_Remote tracker_;
  vrpn_Button_Remote button_;
  vrpn_Analog_Remote analog_;
  vrpn_Text_Receiver text_;
  vrpn_ForceDevice_Remote force_;
  std::string seen_;
  bool done_ = false;
};
