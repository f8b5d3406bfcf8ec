// Topics that put forces on the hand, and stop it.
#pragma once

#include <messages.h>

#include <string>

#include "frame.h"
#include "hapticd/client.h"
#include "participant.h"
#include "topic_log.h"

namespace hapticd::apps::ros2 {

/// Passes the samples of servo_cf and state_command to the server. A sample that is wrong is left out, with a
/// line in the log. Client and participant outlive it; it belongs to the client's thread.
class ControlIn {
 public:
  /// `base`: the frame_id that samples may have, besides none.
  ControlIn(Client& client, const Participant& participant, const Frame& frame, std::string base);

  /// What has arrived. Waits for the server to confirm a stop, and for nothing else. Throws what the client's
  /// calls throw.
  void take();

 private:
  void takeStates();
  void takeForces();

  Client& client_;
  Frame frame_;
  std::string base_;
  TopicLog log_;
  Reader<geometry_msgs_msg_dds__WrenchStamped_> forces_;
  Reader<crtk_msgs_msg_dds__StringStamped_> states_;
};

}  // namespace hapticd::apps::ros2
