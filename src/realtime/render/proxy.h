// The proxy (god-object): the point that follows the hand and never crosses a touchable face.
//
// Zilles & Salisbury 1995; Ruspini, Kolarov & Khatib 1997; Ortega, Redon & Coquillart 2007. In each tick the
// proxy goes to the point nearest to the HIP that up to three planes allow. Whenever it has arrived, all
// planes are dropped and only those that really stand in the way come back, so that no plane holds it longer
// than a tick. With Coulomb friction it stays where it sticks, and slides with the target drawn back by the
// cone.
#pragma once

#include "realtime/render/contact_query.h"

namespace hapticd::realtime {

inline constexpr int kMaxCasts = 128;     ///< in one tick; a path over 0.2 mm cells at 1 m/s needs about 20
inline constexpr double kJump_m = 0.030;  ///< farther in one tick is a jump, not a motion
inline constexpr double kGatherMargin_m = 10e-6;  ///< the tremor of a hand

/// One face that holds the proxy against the hand.
struct ContactConstraint {
  std::int32_t object = -1;  ///< its id; -1 when it is a plane of the scene
  int source = 0;            ///< position among the near objects; -1 - position among the planes of the scene
  std::uint32_t triangle = 0;
  scene::Surface surface;
  Vec3 forceDirection = Vec3::Zero();  ///< unit direction of its force; the plane's normal unless shaded
  double adhesion_N = 0;     ///< tangential force it bears besides friction
  HalfSpace halfSpace;
  double depth_m = 0;                           ///< of the HIP below the surface, along the normal
  Vec3 surfaceVelocity_m_per_s = Vec3::Zero();  ///< at the proxy
};

/// How the surfaces hold the proxy: proxy - HIP = normal_m + lateral_m.
struct ContactSet {
  int count = 0;  ///< 0: free
  std::array<ContactConstraint, kMaxActive> constraints;
  Vec3 normal_m = Vec3::Zero();   ///< sum of depth times normal over the touches
  Vec3 lateral_m = Vec3::Zero();  ///< the tangential part that friction bears
  bool sliding = false;
};

/// Carries the proxy from tick to tick. Fixed storage; noexcept, allocation-free.
class Proxy {
 public:
  Proxy(double toolRadius_m, bool forceShading) noexcept
      : query_(toolRadius_m), forceShading_(forceShading) {}

  void reset() noexcept;

  /// One tick: carries and pushes the proxy with the geometry, follows the HIP, and says what holds it. Adds
  /// RenderStatus bits to `status`.
  const ContactSet& follow(const SceneAtTime& now, const Vec3& hip, double period_s, std::uint32_t& status) noexcept;

  const Vec3& position() const noexcept { return position_; }
  const ContactSet& contactSet() const noexcept { return contactSet_; }
  PlacedPlanes& planes() noexcept { return planes_; }

 private:
  struct ActiveSet {
    std::array<ObjectHit, kMaxHalfSpaces> hits;
    int count = 0;
  };

  struct DescentDirections;  // down from a place among a few faces

  struct FrictionCone {
    double sticking_m = 0;
    double sliding_m = 0;
  };

  void startAt(const SceneAtTime& now, const Vec3& hip) noexcept;
  void carry(const Vec3& hip, std::uint32_t& status) noexcept;
  Vec3 carriedBy(const PlacedObject& object, std::uint32_t triangle, const Vec3& p) const noexcept;
  void push(const Vec3& from, std::uint32_t& status) noexcept;
  void pushByDeformingFaces(const Vec3& from, double reach, std::uint32_t& status) noexcept;
  void pushByPlanes(std::uint32_t& status) noexcept;
  void updateProxy(const Vec3& hip) noexcept;
  void moveFrictionless(const Vec3& target, ActiveSet& active) noexcept;
  bool approach(const Vec3& target, bool stopAtFirst, ActiveSet& active, Vec3& goal) noexcept;
  bool escapeCorner(const Vec3& target, const ActiveSet& active) noexcept;
  void extrapolateStep(const Vec3& step, const Vec3& target) noexcept;
  void collectTouchedFaces(DescentDirections& descent) noexcept;
  void findDescentDirections(const Vec3& pull, const ActiveSet& active, DescentDirections& descent) const noexcept;
  double freeShare(const DescentDirections& descent, const Vec3& from, const Vec3& to) const noexcept;
  void findConstraints(const Vec3& hip, ActiveSet& active) noexcept;
  bool frictionless() const noexcept;
  static FrictionCone frictionConeOf(const ContactSet& contactSet) noexcept;
  void updateContactSet(const Vec3& hip, const Vec3& goal, const ActiveSet& active) noexcept;
  void popThrough(const Vec3& hip, std::uint32_t& status) noexcept;
  void applyForceShading() noexcept;
  void releaseWhenDeep(bool wasFree, std::uint32_t& status) noexcept;

  ContactQuery query_;
  bool forceShading_;
  PlacedPlanes planes_;
  SceneAtTime now_;
  SceneAtTime before_;
  double period_s_ = 1e-3;
  double expectedTravel_m_ = 0;    // how far the proxy is expected to go in this tick
  int casts_ = 0;          // spent in this tick
  bool started_ = false;    // false until the first tick
  bool popthroughArmed_ = true;      // may pop through
  bool released_ = false;  // given up until the hand leaves
  Vec3 position_ = Vec3::Zero();
  Vec3 positionBefore_ = Vec3::Zero();
  Vec3 hipBefore_ = Vec3::Zero();
  Vec3 slipDirection_ = Vec3::Zero();
  ContactSet contactSet_;
  std::int32_t touchedObject_ = -1;
  std::uint32_t touchedTriangle_ = 0;
};

}  // namespace hapticd::realtime
