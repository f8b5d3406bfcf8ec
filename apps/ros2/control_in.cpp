#include "control_in.h"

#include <optional>
#include <utility>

#include "base/printable.h"
#include "hapticd/error.h"

namespace hapticd::apps::ros2 {
namespace {

constexpr const char* kForces = "servo_cf";
constexpr const char* kStates = "state_command";

Eigen::Vector3d eigen(const geometry_msgs_msg_dds__Vector3_& v) {
  return {v.x, v.y, v.z};
}

}  // namespace

ControlIn::ControlIn(Client& client, const Participant& participant, const Frame& frame, std::string base)
    : client_(client),
      frame_(frame),
      base_(std::move(base)),
      log_(participant),
      forces_(participant, geometry_msgs_msg_dds__WrenchStamped__desc, kForces),
      states_(participant, crtk_msgs_msg_dds__StringStamped__desc, kStates, Delivery::state) {}

void ControlIn::take() {
  takeStates();  // a stop first
  takeForces();
}

void ControlIn::takeStates() {
  states_.take([&](const crtk_msgs_msg_dds__StringStamped_& sample) {
    const std::string text = sample.text;
    if (text != "disable" && text != "pause" && text != "enable" && text != "resume")
      return log_.ignored(kStates, "'" + base::printable(text) +
                                       "' is not known; known are disable, pause, enable and resume");
    try {
      text == "disable" || text == "pause" ? client_.stopForces() : client_.rearmForces();
      log(std::string(kStates) + ": " + text);
    } catch (const Error& error) {
      log(std::string(kStates) + ": " + text + " failed: " + error.what());
    }
  });
}

void ControlIn::takeForces() {
  std::optional<geometry_msgs_msg_dds__Wrench_> newest;
  forces_.take([&](const geometry_msgs_msg_dds__WrenchStamped_& sample) {
    newest.reset();
    const bool finite = (eigen(sample.wrench.force) + eigen(sample.wrench.torque)).allFinite();
    const std::string reason =
        finite ? wrongFrame(sample.header.frame_id, base_) : "a force or torque is not finite";
    if (!reason.empty()) return log_.ignored(kForces, reason);
    newest = sample.wrench;
  });
  if (newest) client_.setForce(frame_.toServer(eigen(newest->force)), frame_.toServer(eigen(newest->torque)));
}

}  // namespace hapticd::apps::ros2
