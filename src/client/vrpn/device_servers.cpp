// Tracker, button and analog: what servers of these devices do.
#include <algorithm>
#include <cstdio>

#include "client/vrpn/messages.h"
#include "hapticd/vrpn/vrpn_Analog.h"
#include "hapticd/vrpn/vrpn_Button.h"
#include "hapticd/vrpn/vrpn_Tracker.h"

namespace wire = hapticd::wire;
using hapticd::client::arrayOf;
using hapticd::client::receiveMessage;
using hapticd::client::sendMessage;
using hapticd::client::writePayload;

namespace {

constexpr std::size_t kLargestPayload = 2048;  // the states of 256 buttons, 128 channels

timeval orNow(const timeval& time) {
  if (time.tv_sec != 0 || time.tv_usec != 0) return time;
  timeval now;
  vrpn_gettimeofday(&now);
  return now;
}

}  // namespace

// --- tracker

vrpn_Tracker::vrpn_Tracker(const char* name, vrpn_Connection* connection, const char*)
    : vrpn_BaseClass(name, connection) {
  vrpn_Tracker::register_types();
}

int vrpn_Tracker::register_types() {
  if (!d_connection) return 0;
  const auto type = [this](const char* name) { return d_connection->register_message_type(name); };
  position_m_id = type("vrpn_Tracker Pos_Quat");
  velocity_m_id = type("vrpn_Tracker Velocity");
  accel_m_id = type("vrpn_Tracker Acceleration");
  tracker2room_m_id = type("vrpn_Tracker To_Room");
  unit2sensor_m_id = type("vrpn_Tracker Unit_To_Sensor");
  workspace_m_id = type("vrpn_Tracker Workspace");
  request_t2r_m_id = type("vrpn_Tracker Request_Tracker_To_Room");
  request_u2s_m_id = type("vrpn_Tracker Request_Unit_To_Sensor");
  request_workspace_m_id = type("vrpn_Tracker Request_Tracker_Workspace");
  update_rate_id = type("vrpn_Tracker set_update_rate");
  reset_origin_m_id = type("vrpn_Tracker Reset_Origin");
  connection_dropped_m_id = type(vrpn_dropped_connection);
  return 0;
}

void vrpn_Tracker::print_latest_report() {
  printf("sensor %d of %s: position %g %g %g m, quaternion %g %g %g %g\n", d_sensor, d_servicename, pos[0],
         pos[1], pos[2], d_quat[0], d_quat[1], d_quat[2], d_quat[3]);
}

int vrpn_Tracker::register_server_handlers() {
  if (!d_connection) return -1;
  register_autodeleted_handler(request_t2r_m_id, handle_t2r_request, this, d_sender_id);
  register_autodeleted_handler(request_u2s_m_id, handle_u2s_request, this, d_sender_id);
  register_autodeleted_handler(request_workspace_m_id, handle_workspace_request, this, d_sender_id);
  return 0;
}

void vrpn_Tracker::get_local_t2r(vrpn_float64* position, vrpn_float64* quaternion) {
  std::copy_n(tracker2room, 3, position);
  std::copy_n(tracker2room_quat, 4, quaternion);
}

void vrpn_Tracker::get_local_u2s(vrpn_int32 sensor, vrpn_float64* position, vrpn_float64* quaternion) {
  const Pose pose = sensor >= 0 && static_cast<std::size_t>(sensor) < unit2sensors_.size()
                        ? unit2sensors_[static_cast<std::size_t>(sensor)]
                        : Pose();
  std::copy_n(pose.position, 3, position);
  std::copy_n(pose.quaternion, 4, quaternion);
}

bool vrpn_Tracker::ensure_enough_unit2sensors(unsigned number) {
  if (unit2sensors_.size() < number) unit2sensors_.resize(number);
  return true;
}

int vrpn_Tracker::handle_t2r_request(void* tracker, vrpn_HANDLERPARAM) {
  auto* self = static_cast<vrpn_Tracker*>(tracker);
  char payload[kLargestPayload];
  const int size = self->encode_tracker2room_to(payload);
  return self->d_connection->pack_message(static_cast<vrpn_uint32>(size), orNow({}), self->tracker2room_m_id,
                                          self->d_sender_id, payload, vrpn_CONNECTION_RELIABLE);
}

int vrpn_Tracker::handle_u2s_request(void* tracker, vrpn_HANDLERPARAM) {
  auto* self = static_cast<vrpn_Tracker*>(tracker);
  char payload[kLargestPayload];
  for (self->d_sensor = 0; self->d_sensor < self->num_sensors; ++self->d_sensor) {
    const int size = self->encode_unit2sensor_to(payload);
    self->d_connection->pack_message(static_cast<vrpn_uint32>(size), orNow({}), self->unit2sensor_m_id,
                                     self->d_sender_id, payload, vrpn_CONNECTION_RELIABLE);
  }
  self->d_sensor = 0;
  return 0;
}

int vrpn_Tracker::handle_workspace_request(void* tracker, vrpn_HANDLERPARAM) {
  auto* self = static_cast<vrpn_Tracker*>(tracker);
  char payload[kLargestPayload];
  const int size = self->encode_workspace_to(payload);
  return self->d_connection->pack_message(static_cast<vrpn_uint32>(size), orNow({}), self->workspace_m_id,
                                          self->d_sender_id, payload, vrpn_CONNECTION_RELIABLE);
}

int vrpn_Tracker::encode_to(char* buffer) {
  return writePayload(wire::TrackerPosQuat{d_sensor, d_sensor, arrayOf<3>(pos), arrayOf<4>(d_quat)}, buffer);
}
int vrpn_Tracker::encode_vel_to(char* buffer) {
  return writePayload(
      wire::TrackerVelocity{d_sensor, d_sensor, arrayOf<3>(vel), arrayOf<4>(vel_quat), vel_quat_dt}, buffer);
}
int vrpn_Tracker::encode_acc_to(char* buffer) {
  return writePayload(
      wire::TrackerAcceleration{d_sensor, d_sensor, arrayOf<3>(acc), arrayOf<4>(acc_quat), acc_quat_dt},
      buffer);
}
int vrpn_Tracker::encode_tracker2room_to(char* buffer) {
  return writePayload(wire::TrackerToRoom{arrayOf<3>(tracker2room), arrayOf<4>(tracker2room_quat)}, buffer);
}
int vrpn_Tracker::encode_unit2sensor_to(char* buffer) {
  Pose pose;
  get_local_u2s(d_sensor, pose.position, pose.quaternion);
  return writePayload(
      wire::TrackerUnitToSensor{d_sensor, 0, arrayOf<3>(pose.position), arrayOf<4>(pose.quaternion)}, buffer);
}
int vrpn_Tracker::encode_workspace_to(char* buffer) {
  return writePayload(wire::TrackerWorkspace{arrayOf<3>(workspace_min), arrayOf<3>(workspace_max)}, buffer);
}

vrpn_Tracker_Server::vrpn_Tracker_Server(const char* name, vrpn_Connection* connection, vrpn_int32 sensors)
    : vrpn_Tracker(name, connection) {
  num_sensors = sensors;
  register_server_handlers();
}

int vrpn_Tracker_Server::report(int sensor, const timeval& time, vrpn_int32 type,
                                int (vrpn_Tracker::*encode)(char*), vrpn_uint32 class_of_service) {
  if (!d_connection) return -1;
  if (sensor < 0 || sensor >= num_sensors) {
    fprintf(stderr, "VRPN: %s reports sensor %d, but has %d: construct it with more\n", d_servicename, sensor,
            num_sensors);
    return -1;
  }
  timestamp = time;
  d_sensor = sensor;
  char payload[kLargestPayload];
  const int size = (this->*encode)(payload);
  return d_connection->pack_message(static_cast<vrpn_uint32>(size), time, type, d_sender_id, payload,
                                    class_of_service);
}

int vrpn_Tracker_Server::report_pose(int sensor, timeval time, const vrpn_float64 position[3],
                                     const vrpn_float64 quaternion[4], vrpn_uint32 class_of_service) {
  std::copy_n(position, 3, pos);
  std::copy_n(quaternion, 4, d_quat);
  return report(sensor, time, position_m_id, &vrpn_Tracker_Server::encode_to, class_of_service);
}

int vrpn_Tracker_Server::report_pose_velocity(int sensor, timeval time, const vrpn_float64 velocity[3],
                                              const vrpn_float64 quaternion[4], vrpn_float64 interval_s,
                                              vrpn_uint32 class_of_service) {
  std::copy_n(velocity, 3, vel);
  std::copy_n(quaternion, 4, vel_quat);
  vel_quat_dt = interval_s;
  return report(sensor, time, velocity_m_id, &vrpn_Tracker_Server::encode_vel_to, class_of_service);
}

int vrpn_Tracker_Server::report_pose_acceleration(int sensor, timeval time,
                                                  const vrpn_float64 acceleration[3],
                                                  const vrpn_float64 quaternion[4], vrpn_float64 interval_s,
                                                  vrpn_uint32 class_of_service) {
  std::copy_n(acceleration, 3, acc);
  std::copy_n(quaternion, 4, acc_quat);
  acc_quat_dt = interval_s;
  return report(sensor, time, accel_m_id, &vrpn_Tracker_Server::encode_acc_to, class_of_service);
}

vrpn_Tracker_NULL::vrpn_Tracker_NULL(const char* name, vrpn_Connection* connection, vrpn_int32 sensors,
                                     vrpn_float64 rate_Hz)
    : vrpn_Tracker_Server(name, connection, sensors), update_rate(rate_Hz) {}

void vrpn_Tracker_NULL::mainloop() {
  server_mainloop();
  const timeval now = orNow({});
  // Unsigned, so that a clock that was set back does not end the reports.
  if (static_cast<double>(vrpn_TimevalDuration(now, timestamp)) < 1e6 / update_rate) return;
  const vrpn_float64 zero[3] = {};
  const vrpn_float64 identity[4] = {0, 0, 0, 1};
  for (vrpn_int32 sensor = 0; sensor < num_sensors; ++sensor) {
    report_pose(sensor, now, zero, identity);
    report_pose_velocity(sensor, now, zero, identity, 1);
    report_pose_acceleration(sensor, now, zero, identity, 1);
  }
}

// --- button

vrpn_Button::vrpn_Button(const char* name, vrpn_Connection* connection) : vrpn_BaseClass(name, connection) {
  vrpn_Button::register_types();
}

int vrpn_Button::register_types() {
  if (!d_connection) return 0;
  change_message_id = d_connection->register_message_type("vrpn_Button Change");
  states_message_id = d_connection->register_message_type("vrpn_Button States");
  admin_message_id = d_connection->register_message_type("vrpn_Button Admin");
  return 0;
}

void vrpn_Button::print() {
  printf("buttons of %s:", d_servicename);
  for (vrpn_int32 i = 0; i < num_buttons; ++i) printf(" %d", buttons[i]);
  printf("\n");
}

vrpn_int32 vrpn_Button::encode_to(char* buffer, vrpn_int32 button, vrpn_int32 state) {
  return writePayload(wire::ButtonChange{button, state}, buffer);
}

vrpn_int32 vrpn_Button::encode_states_to(char* buffer) {
  return writePayload(wire::ButtonStates{{{buttons, buttons + num_buttons}}}, buffer);
}

void vrpn_Button::report_changes() {
  for (vrpn_int32 i = 0; i < num_buttons; ++i) {
    if (buttons[i] != lastbuttons[i] && d_connection) {
      char payload[kLargestPayload];
      const vrpn_int32 size = encode_to(payload, i, buttons[i]);
      d_connection->pack_message(static_cast<vrpn_uint32>(size), timestamp, change_message_id, d_sender_id,
                                 payload, vrpn_CONNECTION_RELIABLE);
    }
    lastbuttons[i] = buttons[i];
  }
}

void vrpn_Button::report_states() {
  if (!d_connection) return;
  timestamp = orNow({});
  char payload[kLargestPayload];
  const vrpn_int32 size = encode_states_to(payload);
  d_connection->pack_message(static_cast<vrpn_uint32>(size), timestamp, states_message_id, d_sender_id,
                             payload, vrpn_CONNECTION_RELIABLE);
}

vrpn_Button_Filter::vrpn_Button_Filter(const char* name, vrpn_Connection* connection)
    : vrpn_Button(name, connection) {
  std::fill(std::begin(buttonstate), std::end(buttonstate), vrpn_BUTTON_MOMENTARY);
  if (!d_connection) return;
  alert_message_id = d_connection->register_message_type("vrpn_Button Alert");
  listen("vrpn_Button Admin", handleAdmin, this);
  listen("vrpn_Base ping_message", handleNewClient, this);
  register_autodeleted_handler(d_connection->register_message_type(vrpn_got_connection), handleNewClient,
                               this);
}

int vrpn_Button_Filter::handleNewClient(void* self, vrpn_HANDLERPARAM) {
  static_cast<vrpn_Button_Filter*>(self)->report_states();
  return 0;
}

int vrpn_Button_Filter::handleAdmin(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::ButtonAdmin>(p, [&](const wire::ButtonAdmin& m) {
    auto* filter = static_cast<vrpn_Button_Filter*>(self);
    const bool all = m.button == vrpn_ALL_ID;
    if (m.event == vrpn_BUTTON_MOMENTARY) {
      all ? filter->set_all_momentary() : filter->set_momentary(m.button);
    } else if (m.event == vrpn_BUTTON_TOGGLE_OFF || m.event == vrpn_BUTTON_TOGGLE_ON) {
      all ? filter->set_all_toggle(m.event) : filter->set_toggle(m.button, m.event);
    }
  });
}

void vrpn_Button_Filter::alert(vrpn_int32 button, vrpn_int32 event) {
  if (send_alerts == 0) return;
  sendMessage(d_connection, d_sender_id, wire::ButtonAlert{button, event});
}

void vrpn_Button_Filter::set_momentary(vrpn_int32 button) {
  if (button < 0 || button >= num_buttons) {
    fprintf(stderr, "VRPN: %s has no button %d, the last one is %d\n", d_servicename, button,
            num_buttons - 1);
    return;
  }
  buttonstate[button] = vrpn_BUTTON_MOMENTARY;
  alert(button, vrpn_BUTTON_TOGGLE_OFF);
}

void vrpn_Button_Filter::set_toggle(vrpn_int32 button, vrpn_int32 state) {
  if (button < 0 || button >= num_buttons) {
    fprintf(stderr, "VRPN: %s has no button %d, the last one is %d\n", d_servicename, button,
            num_buttons - 1);
    return;
  }
  buttonstate[button] = state == vrpn_BUTTON_TOGGLE_ON ? vrpn_BUTTON_TOGGLE_ON : vrpn_BUTTON_TOGGLE_OFF;
  alert(button, buttonstate[button]);
}

void vrpn_Button_Filter::set_all_momentary() {
  for (vrpn_int32 i = 0; i < num_buttons; ++i) {
    if (buttonstate[i] != vrpn_BUTTON_MOMENTARY) set_momentary(i);
  }
}
void vrpn_Button_Filter::set_all_toggle(vrpn_int32 state) {
  for (vrpn_int32 i = 0; i < num_buttons; ++i) {
    if (buttonstate[i] == vrpn_BUTTON_MOMENTARY) set_toggle(i, state);
  }
}

void vrpn_Button_Filter::report_changes() {
  for (vrpn_int32 i = 0; i < num_buttons; ++i) {
    const bool pressed = buttons[i] != 0 && lastbuttons[i] == 0;
    const bool changed = buttons[i] != lastbuttons[i];
    lastbuttons[i] = buttons[i];
    vrpn_int32 state = buttons[i];
    if (buttonstate[i] != vrpn_BUTTON_MOMENTARY) {
      if (!pressed) continue;
      state = buttonstate[i] == vrpn_BUTTON_TOGGLE_OFF;
      buttonstate[i] = state != 0 ? vrpn_BUTTON_TOGGLE_ON : vrpn_BUTTON_TOGGLE_OFF;
      alert(i, buttonstate[i]);
    } else if (!changed) {
      continue;
    }
    if (!d_connection) continue;
    char payload[kLargestPayload];
    const vrpn_int32 size = encode_to(payload, i, state);
    d_connection->pack_message(static_cast<vrpn_uint32>(size), timestamp, change_message_id, d_sender_id,
                               payload, vrpn_CONNECTION_RELIABLE);
  }
}

vrpn_int32 vrpn_Button_Filter::encode_states_to(char* buffer) {
  wire::ButtonStates message;
  for (vrpn_int32 i = 0; i < num_buttons; ++i) {
    const bool momentary = buttonstate[i] == vrpn_BUTTON_MOMENTARY;
    message.states.values.push_back(momentary ? buttons[i] : buttonstate[i] == vrpn_BUTTON_TOGGLE_ON);
  }
  return writePayload(message, buffer);
}

vrpn_Button_Server::vrpn_Button_Server(const char* name, vrpn_Connection* connection, int number)
    : vrpn_Button_Filter(name, connection) {
  num_buttons = std::clamp(number, 0, vrpn_BUTTON_MAX_BUTTONS);
}

void vrpn_Button_Server::mainloop() {
  server_mainloop();
  timestamp = orNow({});
  report_changes();
}

int vrpn_Button_Server::set_button(int button, int state) {
  if (button < 0 || button >= num_buttons) return -1;
  buttons[button] = state != 0;
  return 0;
}

// --- analog

vrpn_Analog::vrpn_Analog(const char* name, vrpn_Connection* connection) : vrpn_BaseClass(name, connection) {
  vrpn_Analog::register_types();
}

int vrpn_Analog::register_types() {
  if (d_connection) channel_m_id = d_connection->register_message_type("vrpn_Analog Channel");
  return 0;
}

void vrpn_Analog::print() {
  printf("channels of %s:", d_servicename);
  for (vrpn_int32 i = 0; i < num_channel; ++i) printf(" %g", channel[i]);
  printf("\n");
}

vrpn_int32 vrpn_Analog::encode_to(char* buffer) {
  return writePayload(wire::AnalogChannels{{{channel, channel + num_channel}}}, buffer);
}

void vrpn_Analog::report_changes(vrpn_uint32 class_of_service, const timeval time) {
  if (!std::equal(channel, channel + num_channel, last)) vrpn_Analog::report(class_of_service, time);
}

void vrpn_Analog::report(vrpn_uint32 class_of_service, const timeval time) {
  std::copy_n(channel, num_channel, last);
  if (!d_connection) return;
  timestamp = orNow(time);
  char payload[kLargestPayload];
  const vrpn_int32 size = encode_to(payload);
  d_connection->pack_message(static_cast<vrpn_uint32>(size), timestamp, channel_m_id, d_sender_id, payload,
                             class_of_service);
}

vrpn_Analog_Server::vrpn_Analog_Server(const char* name, vrpn_Connection* connection, vrpn_int32 channels)
    : vrpn_Analog(name, connection) {
  setNumChannels(channels);
}

vrpn_int32 vrpn_Analog_Server::setNumChannels(vrpn_int32 channels) {
  return num_channel = std::clamp(channels, 0, vrpn_CHANNEL_MAX);
}

vrpn_Clipping_Analog_Server::vrpn_Clipping_Analog_Server(const char* name, vrpn_Connection* connection,
                                                         vrpn_int32 channels)
    : vrpn_Analog_Server(name, connection, channels), clips_(vrpn_CHANNEL_MAX, Clip{-1, 0, 0, 1}) {}

int vrpn_Clipping_Analog_Server::setClipValues(int number, double minimum, double lower_zero,
                                               double upper_zero, double maximum) {
  if (number < 0 || number >= num_channel || minimum > lower_zero || lower_zero > upper_zero ||
      upper_zero > maximum)
    return -1;
  clips_[static_cast<std::size_t>(number)] = {minimum, lower_zero, upper_zero, maximum};
  return 0;
}

int vrpn_Clipping_Analog_Server::setChannelValue(int number, double value) {
  if (number < 0 || number >= num_channel) return -1;
  const Clip& clip = clips_[static_cast<std::size_t>(number)];
  double mapped = 0;
  if (value <= clip.minimum) {
    mapped = -1;
  } else if (value >= clip.maximum) {
    mapped = 1;
  } else if (value < clip.lowerZero) {
    mapped = (value - clip.lowerZero) / (clip.lowerZero - clip.minimum);
  } else if (value > clip.upperZero) {
    mapped = (value - clip.upperZero) / (clip.maximum - clip.upperZero);
  }
  channel[number] = mapped;
  return 0;
}
