#include "state_out.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace hapticd::apps::ros2 {
namespace {

using namespace std::chrono_literals;

// Subscribers of ROS 2 do not ask for earlier samples by default: what changes seldom is repeated.
constexpr auto kRepeat = 500ms;

// DDS takes texts and sequences by pointers that it does not write through.
char* text(const std::string& content) {
  return const_cast<char*>(content.c_str());
}

std_msgs_msg_dds__Header_ header(Time time, const std::string& frame) {
  const auto since = std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch());
  const auto seconds = std::chrono::floor<std::chrono::seconds>(since);
  return {{static_cast<std::int32_t>(seconds.count()), static_cast<std::uint32_t>((since - seconds).count())},
          text(frame)};
}

geometry_msgs_msg_dds__Vector3_ vector(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}
geometry_msgs_msg_dds__Quaternion_ quaternion(const Eigen::Quaterniond& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

// A sequence that borrows its elements.
template <class Sequence, class Element>
Sequence borrowed(Element* elements, std::size_t count) {
  const auto size = static_cast<std::uint32_t>(count);
  return {size, size, elements, false};
}

// The state as the Collaborative Robotics Toolkit names it. A latched trip waits for a person.
const char* stateOf(const GuardReport& guard) {
  if (guard.latched != Trips()) return "FAULT";
  return guard.armed && !guard.stopped ? "ENABLED" : "DISABLED";
}

}  // namespace

StateOut::StateOut(Client& client, const Participant& participant, const Frame& frame,
                   const std::string& name, double tfRate_Hz)
    : client_(client),
      frame_(frame),
      handFrame_(name),
      proxyFrame_(name + "_proxy"),
      base_(name + "_base"),
      tfPeriod_(std::chrono::duration_cast<Time::duration>(
          std::chrono::duration<double>(tfRate_Hz > 0 ? 1 / tfRate_Hz : 0))),
      hand_(participant, geometry_msgs_msg_dds__PoseStamped__desc, "measured_cp"),
      velocity_(participant, geometry_msgs_msg_dds__TwistStamped__desc, "measured_cv"),
      force_(participant, geometry_msgs_msg_dds__WrenchStamped__desc, "measured_cf"),
      proxy_(participant, geometry_msgs_msg_dds__PoseStamped__desc, "proxy/measured_cp"),
      depth_(participant, std_msgs_msg_dds__Float64__desc, "contact/depth"),
      object_(participant, std_msgs_msg_dds__Int32__desc, "contact/object"),
      buttons_(participant, sensor_msgs_msg_dds__Joy__desc, "buttons", Delivery::state),
      gripper_(participant, sensor_msgs_msg_dds__JointState__desc, "gripper/measured_js"),
      state_(participant, crtk_msgs_msg_dds__OperatingState__desc, "operating_state", Delivery::state),
      transforms_(participant, tf2_msgs_msg_dds__TFMessage__desc, "/tf") {
  subscriptions_.emplace_back(client.onHand([this](const HandReport& report) { writeHand(report); }));
  subscriptions_.emplace_back(client.onTick([this](const TickReport& report) { writeTick(report); }));
  subscriptions_.emplace_back(client.onGuard([this](const GuardReport& report) { writeState(report.time); }));
  subscriptions_.emplace_back(client.onConnection([this](const ConnectionReport& report) {
    if (!report.connected) writeState(report.time);
  }));
}

PoseStamped StateOut::pose(Time time, const Vec3& position_m, const Quaternion& orientation) const {
  const Eigen::Vector3d p = frame_.fromServer(position_m);
  return {header(time, base_), {{p.x(), p.y(), p.z()}, quaternion(frame_.fromServer(orientation))}};
}

void StateOut::writeHand(const HandReport& report) {
  hand_.write(pose(report.time, report.position_m, report.orientation));
  velocity_.write({header(report.time, base_),
                   {vector(frame_.fromServer(report.velocity_m_per_s)),
                    vector(frame_.fromServer(report.angularVelocity_rad_per_s))}});
  force_.write({header(report.time, base_), {vector(frame_.fromServer(report.force_N)), {0, 0, 0}}});
  if (report.gripper_rad) {
    static const std::string kName = "gripper";
    char* name = text(kName);
    double opening_rad = *report.gripper_rad;
    gripper_.write({header(report.time, base_),
                    borrowed<dds_sequence_string>(&name, 1),
                    borrowed<dds_sequence_double>(&opening_rad, 1),
                    {},
                    {}});
  }
  writeButtons(report);
}

void StateOut::writeButtons(const HandReport& report) {
  if (pressed_ == report.buttons && report.time - buttonsWritten_ < kRepeat) return;
  pressed_ = report.buttons;
  buttonsWritten_ = report.time;
  const auto capabilities = client_.capabilities();
  std::array<std::int32_t, 32> down{};
  const std::size_t count = std::min<std::size_t>(down.size(), capabilities ? capabilities->buttons : 0);
  for (std::size_t i = 0; i < count; ++i) down[i] = static_cast<std::int32_t>(report.buttons >> i & 1U);
  buttons_.write({header(report.time, base_), {}, borrowed<dds_sequence_long>(down.data(), count)});
}

void StateOut::writeTick(const TickReport& report) {
  proxy_.write(pose(report.time, report.proxy_m, report.orientation));
  depth_.write({report.depth_m});
  object_.write({report.object});
  if (tfPeriod_.count() > 0 && report.time >= transformsDue_) {
    transformsDue_ = std::max(transformsDue_ + tfPeriod_, report.time);
    writeTransforms(report);
  }
  if (report.time - stateWritten_ >= kRepeat) writeState(report.time);
}

void StateOut::writeTransforms(const TickReport& report) {
  const auto rotation = quaternion(frame_.fromServer(report.orientation));
  geometry_msgs_msg_dds__TransformStamped_ both[] = {
      {header(report.time, base_), text(handFrame_), {vector(frame_.fromServer(report.hand_m)), rotation}},
      {header(report.time, base_), text(proxyFrame_), {vector(frame_.fromServer(report.proxy_m)), rotation}}};
  transforms_.write({borrowed<dds_sequence_geometry_msgs_msg_dds__TransformStamped_>(both, 2)});
}

void StateOut::writeState(Time time) {
  stateWritten_ = time;
  // Without its server the device is not under control.
  const std::string state = client_.connected() ? stateOf(client_.latest().guard) : "FAULT";
  state_.write({header(time, base_), text(state), client_.connected(), false});
}

}  // namespace hapticd::apps::ros2
