// The proxy (god-object): the point that follows the HIP and never crosses a touchable face.
//
// Zilles & Salisbury 1995; Ruspini, Kolarov & Khatib 1997; Ortega, Redon & Coquillart 2007. In each tick the
// proxy moves to the point nearest to the HIP that up to three half-spaces allow. At each intermediate goal
// the active set is emptied, and only the faces that block the next path enter it again; a half-space
// therefore never holds the proxy longer than one tick. With Coulomb friction the proxy sticks, or it slides
// towards a target that the friction cone draws back. In a groove whose walls move differently, each wall
// bears what it can against the slip over itself; see proxy_friction.cpp.
#pragma once

#include <algorithm>
#include <optional>

#include "realtime/render/contact_query.h"
#include "realtime/render/enclosure.h"
#include "realtime/render/renderer.h"
#include "realtime/render/stiffness_blend.h"

namespace hapticd::realtime {

inline constexpr int kMaxCasts = 128;     ///< per tick; a path over 0.2 mm cells at 1 m/s needs about 20
inline constexpr double kJump_m = 0.030;  ///< a longer move in one tick is a jump
inline constexpr double kFastestHip_m_per_s = 1.2;  ///< a late tick allows a first contact this much deeper
inline constexpr double kLongestTick_s = 0.050;
inline constexpr double kGatherMargin_m = 10e-6;  ///< tremor of the HIP

/// One face that keeps the proxy from the HIP.
struct ContactConstraint {
  std::int32_t object = -1;  ///< id of the object; -1: a plane of the scene
  int source = 0;            ///< index of the near object; -1 - index for a plane of the scene
  std::uint32_t triangle = 0;
  scene::Surface surface;
  Vec3 forceDirection = Vec3::Zero();  ///< unit; the normal of the half-space unless force shading turns it
  double adhesion_N = 0;               ///< tangential force that it bears besides friction
  HalfSpace halfSpace;
  double depth_m = 0;                           ///< of the HIP below the surface, along the normal, >= 0
  Vec3 surfaceVelocity_m_per_s = Vec3::Zero();  ///< at the proxy; of no view
  Vec3 carried_m = Vec3::Zero();                ///< way of the surface there in this tick, with the view
  bool rests = true;                            ///< the surface neither moves nor deforms in this tick
  bool creeps = false;                          ///< or so slowly that its work is negligible
  double pressed = 1;  ///< share of the spring that presses: the damper of a HIP that leaves takes the rest

  /// Of the HIP from the surface, along the normal, metres per second.
  double leavingSpeed(const Vec3& hipVelocity_m_per_s) const noexcept {
    return halfSpace.normal.dot(hipVelocity_m_per_s - surfaceVelocity_m_per_s);
  }
};

/// The faces in contact: proxy - HIP = normal_m + lateral_m.
struct ContactSet {
  int count = 0;  ///< 0: no contact
  std::array<ContactConstraint, kMaxActive> constraints;
  Vec3 normal_m = Vec3::Zero();   ///< sum of depth times normal over the constraints
  Vec3 lateral_m = Vec3::Zero();  ///< the tangential part, which friction bears
  bool sliding = false;
  bool borneApart = false;  ///< by two surfaces that move differently: the first bears borneByFirst_m of it
  double staticShare = 1;  ///< of static friction in the coefficient, the rest is dynamic; see slidingShare()
  /// The spring between HIP and proxy, one for all constraints; see stiffness_blend.h.
  BlendedSpring spring;
  Vec3 borneByFirst_m = Vec3::Zero();

  double frictionOf(const scene::Surface& surface) const noexcept {
    const double dynamic = std::min(surface.dynamicFriction, surface.staticFriction);
    return dynamic + staticShare * (surface.staticFriction - dynamic);
  }
  /// The bound of friction and adhesion of one constraint, as a length of the spring.
  double boundOf(const ContactConstraint& constraint) const noexcept {
    return frictionOf(constraint.surface) * constraint.pressed * constraint.depth_m +
           constraint.adhesion_N / spring.stiffness_N_per_m;
  }
};

/// The proxy and its state from tick to tick. Device frame, metres. Servo thread: noexcept, no allocation.
class Proxy {
 public:
  explicit Proxy(const RenderOptions& options) noexcept
      : toolRadius_(options.toolRadius_m),
        query_(options.toolRadius_m),
        forceShading_(options.forceShading),
        stribeckSpeed_m_per_s_(options.stribeckSpeed_m_per_s) {}

  void reset() noexcept;
  /// Continues between two ticks, free of contact, at the place where it was then.
  void resume(const Vec3& position) noexcept;

  /// One tick: moves the proxy with the geometry, then towards the HIP, and returns what holds it. Adds
  /// RenderStatus bits to `status`.
  const ContactSet& follow(const SceneAtTime& now, const Vec3& hip, const Vec3& hipVelocity_m_per_s,
                           double period_s, std::uint32_t& status) noexcept;

  /// Where the proxy is: for a point tool in contact on the faces themselves, without the standoff.
  const Vec3& position() const noexcept { return reported_; }
  const ContactSet& contactSet() const noexcept { return contactSet_; }
  /// Share of the contact force that is felt, 1 … 0: less than 1 where the work of a tick does not suffice.
  double feltShare() const noexcept { return share_; }
  /// In this tick a command changed what is in contact: surfaces, planes, the workspace.
  bool commandChanged() const noexcept { return commandChanged_; }
  PlacedPlanes& planes() noexcept { return planes_; }
  void forget() noexcept { query_.forget(); }
  /// What the last tick did: casts, how often they tried one facet, and triangles that it examined in all and
  /// to find out what is around the tool.
  int casts() const noexcept { return casts_; }
  int facetCasts() const noexcept { return query_.facetCasts(); }
  int visits() const noexcept { return query_.visits(); }
  int enclosureVisits() const noexcept { return query_.enclosureVisits(); }

 private:
  struct ActiveSet {
    std::array<ObjectHit, kMaxHalfSpaces> hits;
    int count = 0;

    /// Leaves only the hits that hold the proxy at this place.
    void keep(const Projection& nearest) noexcept {
      count = nearest.count;
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        const auto active = static_cast<std::size_t>(nearest.active[i]);
        if (active != i) hits[i] = hits[active];
      }
    }
  };

  struct TouchedFace;
  struct DescentDirections;

  // The faces that pushed the proxy in this tick.
  struct Pushers {
    std::array<HalfSpace, kMaxHalfSpaces> faces;
    int count = 0;
    bool circling = false;  // they push in turn: those that do not hold the proxy stay, too
    bool jammed = false;    // they leave the proxy no room

    void add(const HalfSpace& face) noexcept;
    void keep(const Projection& nearest) noexcept;
  };

  // A face that held the proxy at the end of the last tick.
  struct LastConstraint {
    std::int32_t object = -1;  // id; -1: a plane of the scene
    std::uint32_t triangle = 0;
    HalfSpace halfSpace;
  };

  // A slide, from the breakaway to a reversal or to a pause.
  struct Slide {
    bool active = false;
    Vec3 direction = Vec3::Zero();  // from the HIP to the proxy; also that of the last slide
    double speed_m_per_s = 0;       // mean over the last milliseconds
    double pause_s = 0;             // since the proxy last slipped
    double share = 0.5;             // of its way, where all of it would fill the spring
  };

  // A groove whose walls moved differently along it in this tick. Lengths along the groove, from the proxy.
  struct Groove {
    Vec3 along = Vec3::Zero();
    std::array<double, 2> carried{};  // where each wall alone would have carried the proxy
    std::array<double, 2> bound{};    // of its friction
  };

  // The search out of corners: where that of the last tick ended, for it may take several.
  struct Search {
    int stage = 0;  // which lift; 2: past a vertex
    int direction = 0;
    int visits = 0;  // of this tick, before the present search
    int begin = 0;   // visits of the tick when that began
  };

  void startAt(const SceneAtTime& now, const Vec3& hip) noexcept;
  void beFree() noexcept;
  Vec3 expectedWay(const Vec3& hip) const noexcept;
  void carry(const Vec3& hip, std::uint32_t& status) noexcept;
  void chooseCarrier() noexcept;
  bool turnsAway(const PlacedObject& object) const noexcept;
  bool jumps(std::int32_t id, std::uint32_t triangle) noexcept;
  bool surfacesInContactMove() const noexcept;
  Vec3 carriedBy(const PlacedObject& object, std::uint32_t triangle, const Vec3& p) const noexcept;
  void push(const Vec3& from, std::uint32_t& status) noexcept;
  void leaveOutWhatSwallowed(const Vec3& from) noexcept;
  bool pushUntilFree(const Vec3& from, std::uint32_t& status) noexcept;
  void gatherSweeps(const Vec3& from) noexcept;
  bool pushByObjects(const Vec3& from, Pushers& pushers, std::uint32_t& status) noexcept;
  bool pushByDeformingFaces(const Vec3& from, Pushers& pushers, std::uint32_t& status) noexcept;
  bool pushByPlanes(Pushers& pushers) noexcept;
  void pushTo(const Vec3& place, const HalfSpace& face, Pushers& pushers) noexcept;
  void holdPlanesBack() noexcept;
  bool isJump(const PlacedObject& object) const noexcept;
  bool isJump(const PlacedObject& object, std::uint32_t triangle) const noexcept;
  bool viewMoved() const noexcept;
  Vec3 carriedByView(const Vec3& p) const noexcept;
  bool contactChangedByCommand() const noexcept;
  bool neighboursChangedByCommand(const BlendedSpring& before) const noexcept;
  bool surfacesNearChanged() const noexcept;
  double reachAround(const Vec3& hip) const noexcept;
  void addTouchedWithNewTriangles() noexcept;
  bool liftOutOfNewTriangles() noexcept;
  bool liftOutOf(int object, std::uint64_t changed, EnclosureBudget& budget) noexcept;
  bool liftOutOf(int object, std::uint64_t changed, const Vec3& way, bool pressed,
                 EnclosureBudget& budget) noexcept;
  Vec3 lowestLayer(int object, const Vec3& lifted) noexcept;
  bool isBelowOpen(int object, const Vec3& out, Vec3& lifted) noexcept;
  Vec3 pressOf(const PlacedObject& object) const noexcept;
  void releaseByJump(const PlacedObject& object, std::uint32_t& status) noexcept;
  void takenByJump(const PlacedObject& object) noexcept;
  bool returnFromJump(const Vec3& hip) noexcept;
  static double missedMove(const PlacedObject& object) noexcept;
  void updateProxy(const Vec3& hip) noexcept;
  void updateWithoutFriction(const Vec3& hip, ActiveSet& active) noexcept;
  void slideTo(const Vec3& target, const Vec3& hip, ActiveSet& active) noexcept;
  double storedInSpring() const noexcept;
  bool moveFrictionless(const Vec3& target, ActiveSet& active) noexcept;
  bool approach(const Vec3& target, bool stopAtFirst, ActiveSet& active, Vec3& goal) noexcept;
  bool liftOut(const ActiveSet& active) noexcept;
  void acceptOverlaps(ActiveSet& active) const noexcept;
  bool escapeCorner(const Vec3& target, const ActiveSet& active) noexcept;
  bool searchDescent(const Vec3& target, const ActiveSet& active) noexcept;
  bool searchSpent() const noexcept;
  bool descendFrom(const Vec3& start, int first, int last, const Vec3& target, double enough,
                   DescentDirections& descent) noexcept;
  bool passVertex(const Vec3& target, double enough, DescentDirections& descent) noexcept;
  void extrapolateStep(const Vec3& step, const Vec3& target, const ActiveSet& active) noexcept;
  double cornerSlack() const noexcept;
  void collectTouchedFaces(DescentDirections& descent) noexcept;
  void findDescentDirections(const Vec3& pull, const ActiveSet& active,
                             DescentDirections& descent) const noexcept;
  void prepareStart(TouchedFace& touched, const Vec3& start) const noexcept;
  bool isSurelyBlocked(DescentDirections& descent, const Vec3& direction, const Vec3& end) noexcept;
  double freeShare(DescentDirections& descent, const Vec3& from, const Vec3& to,
                   double enough) const noexcept;
  bool isFree(DescentDirections& descent, const Vec3& from, const Vec3& to, double share,
              const Vec3& start) noexcept;
  void findConstraints(const Vec3& hip, ActiveSet& active) noexcept;
  Projection nearestTo(const Vec3& target, const ActiveSet& active) const noexcept;
  bool restoreConstraints(const Vec3& hip, ActiveSet& active) const noexcept;
  void rememberConstraints() noexcept;
  bool frictionless() const noexcept;
  static double frictionConeOf(const ContactSet& contactSet) noexcept;
  void findPressure() noexcept;
  Vec3 heldBySlope() const noexcept;
  bool slips() noexcept;
  void pressBack(const Vec3& hip, ActiveSet& active) noexcept;
  bool pressOnLostFace(const Vec3& hip, const ActiveSet& active) noexcept;
  static Vec3 alongNormals(const ActiveSet& active, const Vec3& way) noexcept;
  bool isLost(const ObjectHit& face) const noexcept;
  std::optional<Groove> movingGroove() noexcept;
  bool slideInMovingGroove(const Vec3& hip, ActiveSet& active) noexcept;
  void shareOut(const Groove& groove) noexcept;
  double slidingShare() const noexcept;
  void advanceSlide(double slip_m) noexcept;
  Vec3 onFaces(const Vec3& hip, const ActiveSet& active) noexcept;
  Vec3 onFacesThatGoOn(const Vec3& place, const ActiveSet& active) noexcept;
  void updateContactSet(const Vec3& hip, const Vec3& goal, const ActiveSet& active) noexcept;
  void popThrough(const Vec3& hip, std::uint32_t& status) noexcept;
  bool hasWay(std::uint64_t passable, const Vec3& place) noexcept;
  void applyForceShading() noexcept;
  void fadeWhenOverworked(std::uint32_t& status) noexcept;
  void releaseWhenDeep(bool wasFree, std::uint32_t& status) noexcept;

  double toolRadius_;  // 0: a point
  ContactQuery query_;
  bool forceShading_;
  double stribeckSpeed_m_per_s_;
  PlacedPlanes planes_;
  SceneAtTime now_;
  SceneAtTime before_;
  double period_s_ = 1e-3;
  double expectedTravel_m_ = 0;  // path of the proxy expected in this tick
  int casts_ = 0;                // in this tick
  bool started_ = false;         // false until the first tick after a reset
  bool popthroughArmed_ = true;
  int overworked_ = 0;  // ticks in a row whose work was spent
  bool commandChanged_ = false;
  double share_ = 1;
  bool released_ = false;           // contact released until the HIP leaves the surface
  std::uint64_t missed_ = 0;        // deforming objects whose sweep of this tick was not examined whole
  std::int32_t jumper_ = -1;        // id of the object that jumped and released it; -1: none
  Vec3 beforeJump_ = Vec3::Zero();  // where that found the proxy
  bool carriedByJump_ = false;      // in this tick
  bool wasHeld_ = false;            // the contact is that of the tick before
  bool jammed_ = false;             // the last approach found faces that leave the tool no room
  Vec3 position_ = Vec3::Zero();
  Vec3 reported_ = Vec3::Zero();
  Vec3 positionBefore_ = Vec3::Zero();
  Vec3 hipBefore_ = Vec3::Zero();
  Vec3 hipVelocity_m_per_s_ = Vec3::Zero();
  Slide slide_;
  Search search_;
  ContactSet contactSet_;
  std::array<LastConstraint, kMaxActive> lastConstraints_;
  int lastCount_ = 0;
  std::int32_t touchedObject_ = -1;
  std::uint32_t touchedTriangle_ = 0;
};

}  // namespace hapticd::realtime
