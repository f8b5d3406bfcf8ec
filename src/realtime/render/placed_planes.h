// The planes of the scene that belong to no object: where each of them is at this tick.
//
// A plane is a face without edges, always among the facets. What makes it more than that is kept here: a new
// placement comes in under the hand, texture and buzz move it up and down, and adhesion holds on to the hand.
#pragma once

#include <array>

#include "base/time.h"
#include "realtime/render/facet.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;

/// One plane at this tick.
struct PlacedPlane {
  const scene::Plane* state = nullptr;
  Facet facet;             ///< unbounded, device metres; its object is -1 - its position
  scene::Surface surface;  ///< weaker while its owner's plane ramps out
  double insertionDepth_m = 0;      ///< how deep the hand was inside when it was placed in this tick
};

/// All of them, with what is remembered from tick to tick. Fixed storage; noexcept, allocation-free.
class PlacedPlanes {
 public:
  /// Starts a tick: places the planes of `scene` under the hand.
  void place(const scene::SceneSnapshot& scene, Nanos now, const Vec3& hip, const Vec3& proxy,
             double toolRadius_m) noexcept;
  /// Ends it: `touched` has bit i set when plane i holds the proxy.
  void remember(unsigned touched, const Vec3& proxy) noexcept;
  void reset() noexcept { memoryCount_ = 0; }

  const PlacedPlane* begin() const noexcept { return planes_.data(); }
  const PlacedPlane* end() const noexcept { return planes_.data() + count_; }
  const PlacedPlane& operator[](int i) const noexcept { return planes_[static_cast<std::size_t>(i)]; }

  /// Force of the planes that hold on to a hand that leaves them; releases it where it pulls too hard.
  Vec3 adhesion(const Vec3& hip, double toolRadius_m) noexcept;

 private:
  struct Memory {
    std::int32_t index = 0;
    std::uint32_t placement = 0;
    Nanos placed = 0;
    Nanos releaseBegin = -1;
    double depth_m = 0;  ///< of the hand when it was placed
    bool touched = false;
    bool adheres = false;
    Vec3 firstContact = Vec3::Zero();
  };

  Memory& memoryOf(const scene::Plane& plane, Nanos now, double depth_m, bool& fresh) noexcept;
  void forgetAllExcept(const scene::SceneSnapshot& scene) noexcept;
  bool placeOne(const geometry::Affine& T_world_device, Nanos now, const Vec3& hip, const Vec3& proxy,
                double toolRadius_m, PlacedPlane& placed) noexcept;
  static double heightOf(const scene::Plane& plane, const Memory& memory, Nanos now, const Vec3& normal,
                         const Vec3& proxy, double metresPerUnit) noexcept;

  std::array<PlacedPlane, scene::kMaxPlanes> planes_;
  int count_ = 0;
  std::array<Memory, scene::kMaxPlanes> memory_;
  int memoryCount_ = 0;
};

}  // namespace hapticd::realtime
