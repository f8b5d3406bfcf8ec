// What the hand does and feels, as topics.
#pragma once

#include <messages.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "frame.h"
#include "hapticd/client.h"
#include "participant.h"

namespace hapticd::apps::ros2 {

using PoseStamped = geometry_msgs_msg_dds__PoseStamped_;
using TwistStamped = geometry_msgs_msg_dds__TwistStamped_;
using WrenchStamped = geometry_msgs_msg_dds__WrenchStamped_;

/// Writes the reports of one client to topics, from the callbacks of Client::poll(). Names are those of the
/// Collaborative Robotics Toolkit where it has one.
class StateOut {
 public:
  /// `name`: of the hand's frame on /tf; those of proxy and base are NAME_proxy and NAME_base. `tfRate_Hz`:
  /// of /tf, 0: none. Client and participant outlive it.
  StateOut(Client& client, const Participant& participant, const Frame& frame, const std::string& name,
           double tfRate_Hz);
  StateOut(const StateOut&) = delete;
  StateOut& operator=(const StateOut&) = delete;

 private:
  void writeHand(const HandReport& report);
  void writeTick(const TickReport& report);
  void writeTransforms(const TickReport& report);
  void writeButtons(const HandReport& report);
  void writeState(Time time);
  PoseStamped pose(Time time, const Vec3& position_m, const Quaternion& orientation) const;

  Client& client_;
  Frame frame_;
  std::string handFrame_;
  std::string proxyFrame_;
  std::string base_;
  Time::duration tfPeriod_;

  Writer<PoseStamped> hand_;
  Writer<TwistStamped> velocity_;
  Writer<WrenchStamped> force_;
  Writer<PoseStamped> proxy_;
  Writer<std_msgs_msg_dds__Float64_> depth_;
  Writer<std_msgs_msg_dds__Int32_> object_;
  Writer<sensor_msgs_msg_dds__Joy_> buttons_;
  Writer<sensor_msgs_msg_dds__JointState_> gripper_;
  Writer<crtk_msgs_msg_dds__OperatingState_> state_;
  Writer<tf2_msgs_msg_dds__TFMessage_> transforms_;

  std::optional<std::uint32_t> pressed_;
  Time buttonsWritten_;
  Time stateWritten_;
  Time transformsDue_;
  std::vector<ScopedSubscription> subscriptions_;
};

}  // namespace hapticd::apps::ros2
