// Where an object is at a moment: fixed, or on its way between two poses that a client sent.
#pragma once

#include <span>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::scene {

using base::Nanos;
using geometry::Affine;

/// T_world_object as a function of servo time. Immutable; evaluation is noexcept and allocation-free.
class Motion {
 public:
  /// Fixed at the identity.
  Motion() = default;
  /// Fixed at a placement; `jumps` distinguishes placements that were not reached by moving.
  static Motion fixed(const Affine& T_world_object, std::uint32_t jumps = 0);
  /// From one placement to another between two times (rotation by slerp, scale and shear linearly), at rest
  /// outside.
  static Motion between(const Affine& from, const Affine& to, Nanos begin, Nanos end,
                        std::uint32_t jumps = 0);
  /// The same for a pose that arrives while the one before, `before`, is not reached yet.
  Motion& after(const Affine& before) noexcept {
    before_ = before;
    return *this;
  }

  /// What a leader moves in the same time from where this starts to where it ends, this moves as one with it:
  /// the distances between both stay, or scale, all the way.
  Motion& with(const Motion& leader) noexcept;

  /// World from object (world units) at time `now`.
  Affine at(Nanos now) const noexcept;
  /// True while the placement still changes after `now`.
  bool movingAfter(Nanos now) const noexcept { return end_ > begin_ && now < end_; }
  /// How far a point of a ball (object frame) leaves the straight line between its places at both ends, at
  /// most. World units.
  double detour(const geometry::Vec3& centre, double radius) const noexcept;
  /// Box in the world around all that a box of the object's frame sweeps on the way. Empty stays empty.
  geometry::Box sweep(const geometry::Box& box) const;
  /// Upper bound of the distance between the pose before and the destination of any point of `box` (object
  /// frame) that comes within `reach` of `centre` on the way. World units; 0 when no point comes near.
  double longestMoveNear(const geometry::Box& box, const geometry::Vec3& centre, double reach) const noexcept;
  /// The final placement.
  const Affine& destination() const noexcept { return to_; }
  /// Where it started.
  const Affine& origin() const noexcept { return from_; }
  /// Counts placements that are jumps: two motions of one object with the same number join without a gap.
  std::uint32_t jumps() const noexcept { return jumps_; }

 private:
  struct Factors {  // T = translation * rotation * stretch
    geometry::Quat rotation = geometry::Quat::Identity();
    geometry::Mat3 stretch = geometry::Mat3::Identity();
  };
  static Factors factorise(const Affine& t);
  Affine atShare(double share) const noexcept;

  Affine before_ = Affine::Identity();  // the pose before: the origin, or farther on the old way
  Affine from_ = Affine::Identity();
  Affine to_ = Affine::Identity();
  // Of the frame that turns and stretches: the object's own or its leader's.
  Factors fromFactors_;
  Factors toFactors_;
  geometry::Vec3 frameFrom_ = geometry::Vec3::Zero();
  geometry::Vec3 frameTo_ = geometry::Vec3::Zero();
  bool led_ = false;
  Affine T_leader_object_ = Affine::Identity();
  Nanos begin_ = 0;
  Nanos end_ = 0;
  std::uint32_t jumps_ = 0;
};

/// The largest distance between the places of a point of `box` under two placements.
double longestMove(const Affine& from, const Affine& to, const geometry::Box& box) noexcept;
/// The part of `box` that is within `reach` of `centre` under any of these placements, or between two of
/// them.
geometry::Box partNear(const geometry::Box& box, std::span<const Affine> placements,
                       const geometry::Vec3& centre, double reach) noexcept;

}  // namespace hapticd::scene
