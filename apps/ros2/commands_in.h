// Topics that command: forces, stops, and the meshes that the hand touches.
#pragma once

#include <messages.h>

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "frame.h"
#include "hapticd/client.h"
#include "participant.h"

namespace hapticd::apps::ros2 {

/// Objects of the scene that topics describe.
struct ObjectSettings {
  std::vector<std::string> names;  ///< of the topics NAME/mesh and NAME/pose
  int first = 0;                   ///< the object of the first name
  Surface surface;                 ///< of all of them
};

/// Takes the samples of topics, and commands them to the server. A sample that is wrong is left out, with a
/// line in the log.
class CommandsIn {
 public:
  /// `base`: the frame_id that samples may have, besides none. Client and participant outlive it.
  CommandsIn(Client& client, const Participant& participant, const Frame& frame, std::string base,
             const ObjectSettings& objects);
  CommandsIn(const CommandsIn&) = delete;
  CommandsIn& operator=(const CommandsIn&) = delete;

  /// What has arrived. Does not wait for samples, but while a mesh is uploaded.
  void take();
  /// Takes the meshes out of the scene.
  void end();

 private:
  struct Object {
    std::string name;
    int number;
    Reader<shape_msgs_msg_dds__Mesh_> meshes;
    Reader<geometry_msgs_msg_dds__PoseStamped_> poses;
    std::vector<std::array<float, 3>> vertices;  // millimetres
    std::vector<std::array<std::uint32_t, 3>> triangles;
    Matrix4 T_world_object;
    bool known = false;  // a mesh has arrived
    bool stale = false;  // that the server does not have
  };

  void takeForces();
  void takeStates();
  void takeObject(Object& object);
  void takeMesh(Object& object, const shape_msgs_msg_dds__Mesh_& mesh);
  void takePose(Object& object, const geometry_msgs_msg_dds__PoseStamped_& pose);
  void upload(Object& object);
  // Whether the samples of a topic may be in this frame.
  bool inBase(const char* frame, const std::string& topic);
  // One line for each run of the same problem of a topic.
  void problem(const std::string& topic, const std::string& text);

  Client& client_;
  const Participant& participant_;
  Frame frame_;
  std::string base_;
  Surface surface_;
  Reader<geometry_msgs_msg_dds__WrenchStamped_> forces_;
  Reader<crtk_msgs_msg_dds__StringStamped_> states_;
  std::deque<Object> objects_;
  std::map<std::string, std::string> problems_;  // the last one of each topic
  ScopedSubscription connections_;
};

/// Prints a line.
void log(const std::string& text);

}  // namespace hapticd::apps::ros2
