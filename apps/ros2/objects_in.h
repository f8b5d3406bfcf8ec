// Topics whose meshes the hand touches.
#pragma once

#include <messages.h>

#include <array>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "frame.h"
#include "hapticd/client.h"
#include "participant.h"
#include "topic_log.h"

namespace hapticd::apps::ros2 {

/// Objects of the scene that topics describe.
struct ObjectSettings {
  std::vector<std::string> names;  ///< of the topics NAME/mesh and NAME/pose
  int first = 0;                   ///< the object of the first name
  Surface surface;                 ///< of all of them
};

/// Puts the meshes of topics into the scene, and moves them. A sample that is wrong is left out, with a line
/// in the log. Client and participant outlive it; it belongs to the client's thread. A large mesh takes that
/// thread for a second: no stop should wait behind it.
class ObjectsIn {
 public:
  /// `base`: the frame_id that samples may have, besides none.
  ObjectsIn(Client& client, const Participant& participant, const Frame& frame, std::string base,
            const ObjectSettings& settings);
  ObjectsIn(const ObjectsIn&) = delete;
  ObjectsIn& operator=(const ObjectsIn&) = delete;

  /// What has arrived, and what a new server does not have. Throws what the client's calls throw.
  void take();
  /// Takes the meshes out of the scene. Throws as take().
  void clear();

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
    bool stale = false;  // the server does not have it
  };

  void takeMesh(Object& object, const shape_msgs_msg_dds__Mesh_& mesh);
  void takePose(Object& object, const geometry_msgs_msg_dds__PoseStamped_& pose);
  void upload(Object& object);

  Client& client_;
  Frame frame_;
  std::string base_;
  Surface surface_;
  TopicLog log_;
  std::deque<Object> objects_;
  ScopedSubscription connections_;
};

}  // namespace hapticd::apps::ros2
