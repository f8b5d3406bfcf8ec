// Which objects are nearest to the tool, in scenes where more boxes surround it than fit into a tick.
//
// Keeps a lower bound of the distance between the tool and the surface of each object. A bound falls with the
// travel of the tool, so that a tick examines only objects whose bound has run out, and a few more in turn.
// The number of examined objects is bounded; it depends on the snapshots and on the ticks before, never on
// time.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "base/time.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Vec3;

/// An upper bound of the largest singular value, exact for similarities: how much a placement stretches
/// lengths.
double stretchOf(const geometry::Mat3& m) noexcept;

/// Servo thread: noexcept, fixed storage, no allocation.
class ObjectDistances {
 public:
  static constexpr int kMaxTracked = 16'384;
  static constexpr int kRoom = 60;

  struct Candidate {
    double distance_m = 0;     ///< of the surface from the tool, at least
    std::uint32_t object = 0;  ///< position in SceneSnapshot::objects
    bool fresh = false;        ///< found for the first time: it appeared
    bool isBound = false;      ///< not examined in this tick: it may be farther
  };
  struct Nearest {
    std::array<Candidate, kRoom> candidates;
    int count = 0;
    double free_m = std::numeric_limits<double>::infinity();  ///< no other known object is nearer
    bool complete = true;                                     ///< every object is tracked
  };

  /// The objects whose surface may be within `reach` of the tool, nearest first. `before` is the time of the
  /// previous tick. Call in every tick, or restart().
  void findNearest(const scene::SceneSnapshot& scene, Nanos now, Nanos before, const Vec3& tool,
                   double reach_m, Nearest& nearest) noexcept;
  /// Forgets everything: all objects count as fresh.
  void restart() noexcept { count_ = 0; }

 private:
  static constexpr float kUnknown = -1;
  static constexpr int kBlock = 64;

  // Of one call of findNearest().
  struct Query {
    const geometry::Affine& T_device_world;
    Nanos now;
    Nanos before;
    const Vec3& tool;
    double reach_m;
  };
  struct ToolInObject {
    Vec3 position = Vec3::Zero();
    double stretch = 0;   // units of the object in a metre, at most
    double outside = 0;   // of the box
    bool exists = false;  // the object has an extent
  };

  float boundOf(double distance_m) const noexcept;
  void follow(const scene::SceneSnapshot& scene, double reach_m) noexcept;
  void followObjects(const scene::SceneSnapshot& scene) noexcept;
  bool followWorkspace(const scene::SceneSnapshot& scene) noexcept;
  float boundAfterMove(const scene::ObjectState& before, const scene::ObjectState& now,
                       float bound) const noexcept;
  static ToolInObject toolIn(const scene::ObjectState& state, const Query& query) noexcept;
  double examine(const scene::ObjectState& state, const Query& query, double& later_m) const noexcept;
  void examineAt(int i, const Query& query, Nearest& nearest) noexcept;
  void meetUnknown(int i, int number, const Query& query, Nearest& nearest) noexcept;
  void examineDue(int due, const Query& query, Nearest& nearest) noexcept;
  void followTool(const Vec3& tool) noexcept;
  bool isBlockBeyond(int first, float limit) const noexcept;
  void consider(Nearest& nearest, const Candidate& candidate) const noexcept;
  int chooseDue(int due) noexcept;

  std::array<float, kMaxTracked> bounds_{};  // lower bound of the distance plus the travel until then
  std::array<float, kMaxTracked> boundsBefore_{};
  std::array<const scene::ObjectState*, kMaxTracked> states_{};
  std::array<const scene::ObjectState*, kMaxTracked> statesBefore_{};
  std::array<std::uint16_t, kMaxTracked> due_{};  // in this tick: objects whose bound has run out
  int count_ = 0;
  bool workspaceMoved_ = false;  // in this tick
  const scene::SceneSnapshot* scene_ = nullptr;
  double metresPerUnit_ = 0;
  double travel_ = 0;
  Vec3 tool_ = Vec3::Zero();
  int turn_ = 0;
};

}  // namespace hapticd::realtime
