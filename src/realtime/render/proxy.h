// The proxy (god-object): the point that follows the hand and never crosses a touchable face.
//
// Zilles & Salisbury 1995; Ruspini, Kolarov & Khatib 1997; Ortega, Redon & Coquillart 2007. In each tick the
// proxy goes to the point nearest to the HIP that up to three planes allow. Whenever it has arrived, all
// planes are dropped and only those that really stand in the way come back, so that no plane holds it longer
// than a tick. With Coulomb friction it stays where it sticks, and slides with the target drawn back by the
// cone.
#pragma once

#include "realtime/render/nearby.h"

namespace hapticd::realtime {

inline constexpr int kMaxCasts = 128;     ///< in one tick; a path over 0.2 mm cells at 1 m/s needs about 20
inline constexpr double kJump_m = 0.030;  ///< farther in one tick is a jump, not a motion
inline constexpr double kGatherMargin_m = 10e-6;  ///< the tremor of a hand

/// One face that holds the proxy against the hand.
struct Touch {
  std::int32_t object = -1;  ///< its id; -1 when it is a plane of the scene
  int source = 0;            ///< position among the near objects; -1 - position among the planes of the scene
  std::uint32_t triangle = 0;
  scene::Surface surface;
  Vec3 push = Vec3::Zero();  ///< unit direction of its force; the plane's normal unless shaded
  double adhesion_N = 0;     ///< tangential force it bears besides friction
  Plane plane;
  double depth_m = 0;                           ///< of the HIP below the surface, along the normal
  Vec3 surfaceVelocity_m_per_s = Vec3::Zero();  ///< at the proxy
};

/// How the surfaces hold the proxy: proxy - HIP = normal_m + lateral_m.
struct Grip {
  int count = 0;  ///< 0: free
  std::array<Touch, kMaxActive> touches;
  Vec3 normal_m = Vec3::Zero();   ///< sum of depth times normal over the touches
  Vec3 lateral_m = Vec3::Zero();  ///< the tangential part that friction bears
  bool sliding = false;
};

/// Carries the proxy from tick to tick. Fixed storage; noexcept, allocation-free.
class Proxy {
 public:
  Proxy(double toolRadius_m, bool forceShading) noexcept
      : nearby_(toolRadius_m), forceShading_(forceShading) {}

  void reset() noexcept;

  /// One tick: carries and pushes the proxy with the geometry, follows the HIP, and says what holds it. Adds
  /// RenderStatus bits to `status`.
  const Grip& follow(const Moment& now, const Vec3& hip, double period_s, std::uint32_t& status) noexcept;

  const Vec3& position() const noexcept { return position_; }
  const Grip& grip() const noexcept { return grip_; }
  HalfSpaces& planes() noexcept { return planes_; }

 private:
  struct ActiveSet {
    std::array<Hit, kMaxPlanes> hits;
    int count = 0;
  };

  struct Ways;  // down from a place among a few faces

  struct Cone {
    double sticking_m = 0;
    double sliding_m = 0;
  };

  void place(const Moment& now, const Vec3& hip) noexcept;
  void carry(const Vec3& hip, std::uint32_t& status) noexcept;
  Vec3 carriedBy(const PlacedObject& object, std::uint32_t triangle, const Vec3& p) const noexcept;
  void push(const Vec3& from, std::uint32_t& status) noexcept;
  void pushByDeforming(const Vec3& from, double reach, std::uint32_t& status) noexcept;
  void pushByPlanes(std::uint32_t& status) noexcept;
  void chase(const Vec3& hip) noexcept;
  void slide(const Vec3& target, ActiveSet& active) noexcept;
  bool approach(const Vec3& target, bool hold, ActiveSet& active, Vec3& goal) noexcept;
  bool escape(const Vec3& target, const ActiveSet& active) noexcept;
  void leap(const Vec3& stride, const Vec3& target) noexcept;
  void findFaces(Ways& ways) noexcept;
  void findWays(const Vec3& pull, const ActiveSet& active, Ways& ways) const noexcept;
  double freeAmong(const Ways& ways, const Vec3& from, const Vec3& to) const noexcept;
  void hold(const Vec3& hip, ActiveSet& active) noexcept;
  bool frictionless() const noexcept;
  static Cone coneOf(const Grip& grip) noexcept;
  void describe(const Vec3& hip, const Vec3& goal, const ActiveSet& active) noexcept;
  void popThrough(const Vec3& hip, std::uint32_t& status) noexcept;
  void shade() noexcept;
  void releaseWhenDeep(bool wasFree, std::uint32_t& status) noexcept;

  Nearby nearby_;
  bool forceShading_;
  HalfSpaces planes_;
  Moment now_;
  Moment before_;
  double period_s_ = 1e-3;
  double stride_m_ = 0;    // how far the proxy is expected to go in this tick
  int casts_ = 0;          // spent in this tick
  bool placed_ = false;    // false until the first tick
  bool armed_ = true;      // may pop through
  bool released_ = false;  // given up until the hand leaves
  Vec3 position_ = Vec3::Zero();
  Vec3 positionBefore_ = Vec3::Zero();
  Vec3 hipBefore_ = Vec3::Zero();
  Vec3 slipDirection_ = Vec3::Zero();
  Grip grip_;
  std::int32_t touchedObject_ = -1;
  std::uint32_t touchedTriangle_ = 0;
};

}  // namespace hapticd::realtime
