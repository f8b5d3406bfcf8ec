// Tracker, button, analog and dial.
#include <algorithm>

#include "client/vrpn/messages.h"
#include "hapticd/vrpn/vrpn_Analog.h"
#include "hapticd/vrpn/vrpn_Button.h"
#include "hapticd/vrpn/vrpn_Dial.h"
#include "hapticd/vrpn/vrpn_Tracker.h"

namespace wire = hapticd::wire;
using hapticd::client::copyTo;
using hapticd::client::receiveMessage;
using hapticd::client::sendMessage;

// --- analog

vrpn_Analog_Remote::vrpn_Analog_Remote(const char* name, vrpn_Connection* connection)
    : vrpn_Analog(name, connection) {
  listen("vrpn_Analog Channel", handleChange, this);
}

int vrpn_Analog_Remote::handleChange(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::AnalogChannels>(p, [&](const wire::AnalogChannels& m) {
    auto* remote = static_cast<vrpn_Analog_Remote*>(self);
    vrpn_ANALOGCB report{};
    report.msg_time = p.msg_time;
    report.num_channel = static_cast<vrpn_int32>(m.channels.values.size());
    std::copy(m.channels.values.begin(), m.channels.values.end(), report.channel);
    std::copy(m.channels.values.begin(), m.channels.values.end(), remote->channel);
    remote->num_channel = report.num_channel;
    remote->changes_.call_handlers(report);
  });
}

// --- button

void vrpn_Button::set_momentary(vrpn_int32 button) {
  sendMessage(d_connection, d_sender_id, wire::ButtonAdmin{button, wire::kButtonMomentary});
}
void vrpn_Button::set_toggle(vrpn_int32 button, vrpn_int32 state) {
  const bool on = state == VRPN_BUTTON_ON || state == vrpn_BUTTON_TOGGLE_ON;
  sendMessage(d_connection, d_sender_id,
              wire::ButtonAdmin{button, on ? wire::kButtonToggleOn : wire::kButtonToggleOff});
}

vrpn_Button_Remote::vrpn_Button_Remote(const char* name, vrpn_Connection* connection)
    : vrpn_Button(name, connection) {
  listen("vrpn_Button Change", handleChange, this);
  listen("vrpn_Button States", handleStates, this);
}

int vrpn_Button_Remote::handleChange(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::ButtonChange>(p, [&](const wire::ButtonChange& m) {
    auto* remote = static_cast<vrpn_Button_Remote*>(self);
    if (m.button >= 0 && m.button < vrpn_BUTTON_MAX_BUTTONS) {
      remote->num_buttons = std::max(remote->num_buttons, m.button + 1);
      remote->buttons[m.button] = m.state != 0;
    }
    remote->changes_.call_handlers({p.msg_time, m.button, m.state});
  });
}

int vrpn_Button_Remote::handleStates(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::ButtonStates>(p, [&](const wire::ButtonStates& m) {
    vrpn_BUTTONSTATESCB report{};
    report.msg_time = p.msg_time;
    report.num_buttons = static_cast<vrpn_int32>(m.states.values.size());
    std::copy(m.states.values.begin(), m.states.values.end(), report.states);
    auto* remote = static_cast<vrpn_Button_Remote*>(self);
    remote->num_buttons = report.num_buttons;
    std::transform(m.states.values.begin(), m.states.values.end(), remote->buttons,
                   [](std::int32_t state) { return static_cast<unsigned char>(state != 0); });
    remote->states_.call_handlers(report);
  });
}

// --- dial

vrpn_Dial_Remote::vrpn_Dial_Remote(const char* name, vrpn_Connection* connection)
    : vrpn_Dial(name, connection) {
  listen("vrpn_Dial update", handleChange, this);
}

// Servers of this project have no dials, so the message is not in the wire table.
int vrpn_Dial_Remote::handleChange(void* self, vrpn_HANDLERPARAM p) {
  vrpn_DIALCB report{p.msg_time, 0, 0};
  if (p.payload_len < static_cast<vrpn_int32>(sizeof report.change + sizeof report.dial)) return 0;
  const char* payload = p.buffer;
  vrpn_unbuffer(&payload, &report.change);
  vrpn_unbuffer(&payload, &report.dial);
  static_cast<vrpn_Dial_Remote*>(self)->changes_.call_handlers(report);
  return 0;
}

// --- tracker

vrpn_Tracker_Remote::vrpn_Tracker_Remote(const char* name, vrpn_Connection* connection)
    : vrpn_Tracker(name, connection) {
  listen("vrpn_Tracker Pos_Quat", handlePose, this);
  listen("vrpn_Tracker Velocity", handleVelocity, this);
  listen("vrpn_Tracker Acceleration", handleAcceleration, this);
  listen("vrpn_Tracker To_Room", handleRoom, this);
  listen("vrpn_Tracker Unit_To_Sensor", handleMount, this);
  listen("vrpn_Tracker Workspace", handleWorkspace, this);
}

int vrpn_Tracker_Remote::request_t2r_xform() {
  sendMessage(d_connection, d_sender_id, wire::TrackerRequestToRoom{});
  return 0;
}
int vrpn_Tracker_Remote::request_u2s_xform() {
  sendMessage(d_connection, d_sender_id, wire::TrackerRequestUnitToSensor{});
  return 0;
}
int vrpn_Tracker_Remote::request_workspace() {
  sendMessage(d_connection, d_sender_id, wire::TrackerRequestWorkspace{});
  return 0;
}
int vrpn_Tracker_Remote::set_update_rate(vrpn_float64 rate_Hz) {
  sendMessage(d_connection, d_sender_id, wire::TrackerSetUpdateRate{rate_Hz});
  return 0;
}
int vrpn_Tracker_Remote::reset_origin() {
  sendMessage(d_connection, d_sender_id, wire::TrackerResetOrigin{});
  return 0;
}

template <class Report>
void vrpn_Tracker_Remote::callSensor(vrpn_Callback_List<Report> Sensor::*list, const Report& report) {
  if (report.sensor < 0) return;
  for (const vrpn_int32 sensor : {vrpn_ALL_SENSORS, report.sensor}) {
    const auto found = sensors_.find(sensor);
    if (found != sensors_.end()) (found->second.*list).call_handlers(report);
  }
}

int vrpn_Tracker_Remote::handlePose(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TrackerPosQuat>(p, [&](const wire::TrackerPosQuat& m) {
    vrpn_TRACKERCB report{p.msg_time, m.sensor, {}, {}};
    copyTo(report.pos, m.position);
    copyTo(report.quat, m.orientation);
    auto* remote = static_cast<vrpn_Tracker_Remote*>(self);
    remote->d_sensor = m.sensor;
    copyTo(remote->pos, m.position);
    copyTo(remote->d_quat, m.orientation);
    remote->callSensor(&Sensor::poses, report);
  });
}

int vrpn_Tracker_Remote::handleVelocity(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TrackerVelocity>(p, [&](const wire::TrackerVelocity& m) {
    vrpn_TRACKERVELCB report{p.msg_time, m.sensor, {}, {}, m.interval};
    copyTo(report.vel, m.velocity);
    copyTo(report.vel_quat, m.rotation);
    static_cast<vrpn_Tracker_Remote*>(self)->callSensor(&Sensor::velocities, report);
  });
}

int vrpn_Tracker_Remote::handleAcceleration(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TrackerAcceleration>(p, [&](const wire::TrackerAcceleration& m) {
    vrpn_TRACKERACCCB report{p.msg_time, m.sensor, {}, {}, m.interval};
    copyTo(report.acc, m.acceleration);
    copyTo(report.acc_quat, m.rotation);
    static_cast<vrpn_Tracker_Remote*>(self)->callSensor(&Sensor::accelerations, report);
  });
}

int vrpn_Tracker_Remote::handleMount(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TrackerUnitToSensor>(p, [&](const wire::TrackerUnitToSensor& m) {
    vrpn_TRACKERUNIT2SENSORCB report{p.msg_time, m.sensor, {}, {}};
    copyTo(report.unit2sensor, m.position);
    copyTo(report.unit2sensor_quat, m.orientation);
    static_cast<vrpn_Tracker_Remote*>(self)->callSensor(&Sensor::mounts, report);
  });
}

int vrpn_Tracker_Remote::handleRoom(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TrackerToRoom>(p, [&](const wire::TrackerToRoom& m) {
    vrpn_TRACKERTRACKER2ROOMCB report{p.msg_time, {}, {}};
    copyTo(report.tracker2room, m.position);
    copyTo(report.tracker2room_quat, m.orientation);
    static_cast<vrpn_Tracker_Remote*>(self)->rooms_.call_handlers(report);
  });
}

int vrpn_Tracker_Remote::handleWorkspace(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TrackerWorkspace>(p, [&](const wire::TrackerWorkspace& m) {
    vrpn_TRACKERWORKSPACECB report{p.msg_time, {}, {}};
    copyTo(report.workspace_min, m.min);
    copyTo(report.workspace_max, m.max);
    static_cast<vrpn_Tracker_Remote*>(self)->workspaces_.call_handlers(report);
  });
}
