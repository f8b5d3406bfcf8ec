// The planes of the scene that belong to no object, as they are placed in this tick.
//
// A plane is a facet without edges that every cast tests. This file adds the rest: a new placement rises
// under the HIP, one that ramps out sinks below it, texture and buzz change its height, and adhesion pulls on
// a HIP that leaves.
#pragma once

#include <array>
#include <limits>

#include "base/time.h"
#include "realtime/render/facet.h"
#include "realtime/render/memory.h"
#include "realtime/render/view_motion.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;

/// One plane of the scene in this tick.
struct PlacedPlane {
  const scene::Plane* state = nullptr;
  Facet facet;             ///< unbounded, device metres; facet.object is -1 - index
  scene::Surface surface;  ///< less damped while the plane ramps out
  bool still = false;      ///< its surface is where it was in the world in the tick before
  bool rests = false;      ///< and on the device
  /// What is left of its adhesion, and of its weight among unequal surfaces, while it ramps out: 1 … 0.
  double share = 1;
};

/// With which planes hold a HIP that leaves them, device frame.
struct Adhesion {
  Vec3 force_N = Vec3::Zero();
  Vec3 point_m = Vec3::Zero();  ///< on the plane that pulls hardest
};

/// All planes, with their state from tick to tick. Servo thread: noexcept, no allocation.
class PlacedPlanes {
 public:
  /// Starts a tick: places the planes of `scene`. `hip` in device metres; `radius_m` is that of the ball that
  /// touches the planes. `viewMoved`: the workspace changed.
  void place(const scene::SceneSnapshot& scene, Nanos now, const Vec3& hip, double toolRadius_m,
             double radius_m, bool viewMoved) noexcept;
  /// Ends a tick: bit i of `touched` is set when plane i holds the proxy, in device metres.
  void remember(unsigned touched, const Vec3& proxy) noexcept;
  /// The hand may be anywhere: planes that are above it in the next tick are left out until it has left them.
  void restart() noexcept { anew_ = true; }
  /// Of this tick: a plane is left out.
  bool leavesOut() const noexcept { return leavesOut_; }
  /// False while one is touched, adheres, is left out or ramps out: that is not part of the memory.
  bool remember(RenderMemory& out) const noexcept;
  /// Continues those of the planes that the memory has; nothing touches them.
  void resume(const RenderMemory& memory) noexcept;
  /// In this tick one was placed anew or got other details, or one that is touched vanished or got another
  /// surface; or the view moved a tick ago below a hand that touches one, which textures follow.
  bool changed() const noexcept { return changed_; }

  const PlacedPlane* begin() const noexcept { return planes_.data(); }
  const PlacedPlane* end() const noexcept { return planes_.data() + count_; }
  const PlacedPlane& operator[](int i) const noexcept { return planes_[static_cast<std::size_t>(i)]; }
  /// Lowers a plane for this tick.
  void lower(int i, double depth_m) noexcept {
    Facet& facet = planes_[static_cast<std::size_t>(i)].facet;
    facet.a -= depth_m * facet.normal;
  }

  /// A plane whose limit is exceeded lets go.
  Adhesion adhesion(const Vec3& hip, double toolRadius_m) noexcept;

 private:
  struct Memory {
    std::int32_t index = 0;
    std::uint32_t placement = 0;
    Nanos placed = 0;
    Nanos buzzing = 0;  ///< since when, however often it was placed since
    Nanos releaseBegin = -1;
    double depth_m = 0;  ///< by which the placement brought the HIP below it
    bool rises = false;  ///< it has not risen by all of that yet
    double under_m = 0;  ///< of the HIP below the surface, in the last tick
    /// The same as if it did not sink, and negative above it; -infinity: it was not there.
    double level_m = -std::numeric_limits<double>::infinity();
    scene::Surface surface;
    std::array<double, 6> detail{};  ///< adhesion, texture, buzz
    double wave_m = 0;               ///< height of texture and buzz, in the last tick
    double raised_m = 0;             ///< of the surface above the plane, in the last tick
    bool belowCrest = false;         ///< the HIP is below the crests of the texture
    bool touched = false;            ///< and the tool has not left it since
    bool adheres = false;
    bool leftOut = false;              ///< the hand was found below it, and did not leave it yet
    Vec3 firstContact = Vec3::Zero();  ///< world frame
  };

  Memory& memoryOf(const scene::Plane& plane, Nanos now, double depth_m, double sunk_m, bool& fresh) noexcept;
  void forgetAllExcept(const scene::SceneSnapshot& scene) noexcept;
  bool changes(const scene::SceneSnapshot& scene) const noexcept;
  void followJump(const ViewMotion& view) noexcept;
  bool isTouched() const noexcept;
  bool placeOne(Nanos now, const Vec3& hip, double toolRadius_m, PlacedPlane& placed) noexcept;
  double heightOf(const scene::Plane& plane, Memory& memory, Nanos now, double metresPerUnit) const noexcept;

  std::array<PlacedPlane, scene::kMaxPlanes> planes_;
  int count_ = 0;
  std::array<Memory, scene::kMaxPlanes> memory_;
  int memoryCount_ = 0;
  bool changed_ = false;
  bool anew_ = false;
  bool viewMoved_ = false;
  geometry::Affine T_world_device_ = geometry::Affine::Identity();
  Vec3 proxy_ = Vec3::Zero();          // at the end of the last tick, world frame
  Vec3 proxyOnDevice_ = Vec3::Zero();  // the same in device metres
  Vec3 hip_ = Vec3::Zero();            // in the last tick, device metres
  bool leavesOut_ = false;
};

}  // namespace hapticd::realtime
