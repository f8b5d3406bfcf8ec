#include "truth/referee.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <random>
#include <sstream>

#include "realtime/render/renderer.h"
#include "truth/descent.h"
#include "truth/follower.h"
#include "truth/free_space.h"
#include "truth/reference.h"
#include "truth/stage.h"

namespace hapticd::truth {
namespace {

using realtime::Rendering;

constexpr double kGap_m = 10e-6;               // narrower gaps are closed
constexpr double kFollower_m = 0.49 * kGap_m;  // radius of the ball that follows the proxy
constexpr double kSuspect_m = 30e-6;           // beside a face: a move there is searched for a path
constexpr double kForceTolerance_m = 20e-6;    // times stiffness; twice the gap
constexpr double kWedge_m = 60e-6;  // the reported proxy is at most 50 um from the ball that touches
constexpr double kTouch_m = 25e-6;  // faces within this of the tool may hold it
constexpr double kStuck_m = 10e-6;
constexpr double kDescentReach_m = 1e-3;
constexpr double kRolling_m = 0.505 * kGap_m;  // of the ball of a point tool, a little wider
constexpr double kWider_m = 1.2 * kFollower_m;
constexpr double kFineStep_m = 1e-6;
constexpr double kFineSlack_m = 2e-11;
constexpr double kTremor_m = 1e-6;
constexpr double kFlat = 2e-3;  // share of the pull: flatter directions lead nowhere
constexpr int kTremorTicks = 10;
constexpr unsigned kUnexpected =
    realtime::kRenderNotFinite | realtime::kRenderGeometryJump | realtime::kRenderReleased;
constexpr unsigned kUnfinished = realtime::kRenderIterationLimit | realtime::kRenderCandidateLimit;

std::uint64_t mixed(std::uint64_t a, std::uint64_t b) {
  std::uint64_t x = a + 0x9E3779B97F4A7C15U * (b + 1);
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

// Distance of a vector from the cone of non-negative sums of others. The nearest point of a cone in space is
// a sum of at most three of them: tries all sets.
double distanceFromCone(const Point& f, const std::vector<Point>& n) {
  double nearest = f.norm();
  const auto consider = [&](const Point& sum) { nearest = std::min(nearest, (f - sum).norm()); };
  for (std::size_t i = 0; i < n.size(); ++i) {
    consider(std::max(0.0, n[i].dot(f)) * n[i]);
    for (std::size_t j = 0; j < i; ++j) {
      const Point across = n[i].cross(n[j]);
      if (across.squaredNorm() < 1e-20) continue;
      const double a = across.dot(f.cross(n[j])) / across.squaredNorm();
      const double b = across.dot(n[i].cross(f)) / across.squaredNorm();
      if (a >= 0 && b >= 0) consider(a * n[i] + b * n[j]);
      for (std::size_t k = 0; k < j; ++k) {
        const double determinant = across.dot(n[k]);
        const double u = n[j].cross(n[k]).dot(f) / determinant;
        const double v = n[k].cross(n[i]).dot(f) / determinant;
        const double w = across.dot(f) / determinant;
        if (u >= 0 && v >= 0 && w >= 0) return 0;
      }
    }
  }
  return nearest;
}

// What the hand got from a contact since it was last free, when no spring was loaded. By the trapezoidal
// rule, whose error is at most half of the change of the force times the way, if the force goes straight from
// one tick to the next.
class Work {
 public:
  double gained_J = 0;
  double error_J = 0;

  double surplus() const { return gained_J - error_J; }
  void add(const Rendering& r, double share, const Point& hip, double stiffest) {
    const Point way = begun_ ? Point(hip - hip_) : Point(Point::Zero());
    gained_J += 0.5 * (force_ + r.contactForce_N).dot(way);
    error_J += 0.5 * (r.contactForce_N - force_).norm() * way.norm();
    // A share that returns takes energy from nobody.
    if (touched_ && r.touching && share > share_)
      error_J += 0.5 * (share - share_) * stiffest * (r.proxy_m - hip).squaredNorm();
    begun_ = true;
    touched_ = r.touching;
    share_ = share;
    force_ = r.contactForce_N;
    hip_ = hip;
  }
  void endContact() { gained_J = error_J = 0; }

 private:
  bool begun_ = false;
  bool touched_ = false;
  double share_ = 1;
  Point force_ = Point::Zero();
  Point hip_ = Point::Zero();
};

class Referee {
 public:
  Referee(const Trial& trial, const RefereeOptions& options)
      : trial_(trial),
        options_(options),
        stage_(trial),
        reference_(trial),
        renderer_({trial.toolRadius_m, false}) {
    for (const TrialObject& object : trial.objects) consider(object.material);
    for (const TrialPlane& plane : trial.planes) consider(plane.material);
    static_ = trial.isStatic();
    oneSidedBall_ = trial.sides != Sides::both && trial.toolRadius_m > 0;
  }

  // A trial that does not begin in free space has nothing to judge: inside and outside follow from the
  // history.
  Verdict run() {
    reference_.moveTo(0);
    if (trial_.hips.empty() || !reference_.near(trial_.hips[0], trial_.toolRadius_m + kTouch_m).empty())
      return verdict_;
    if (beyondWalls(trial_.hips[0]) > 0) return verdict_;
    for (std::size_t i = 0; i < trial_.hips.size() && !verdict_.finding; ++i) tick(static_cast<int>(i));
    return verdict_;
  }

 private:
  void consider(const Material& m) {
    stiffest_ = std::max(stiffest_, m.stiffness_N_per_m);
    damping_ = std::max(damping_, m.damping_Ns_per_m);
    friction_ = std::max(friction_, m.staticFriction);
    pops_ = pops_ || (m.popthrough_N > 0 && trial_.toolRadius_m > 0);
  }

  template <class... Words>
  void report(const char* rule, const Words&... words) {
    if (verdict_.finding) return;
    std::ostringstream text;
    text.precision(12);
    (text << ... << words);
    verdict_.finding = Finding{rule, tick_, text.str()};
  }

  void tick(int i) {
    tick_ = i;
    const bool first = i == 0;
    hipBefore_ = first ? trial_.hips[0] : hip_;
    proxyBefore_ = first ? trial_.hips[0] : Point(rendering_.proxy_m);
    touchedBefore_ = !first && rendering_.touching;
    hip_ = trial_.hips[static_cast<std::size_t>(i)];
    velocity_ = (hip_ - hipBefore_) / kPeriod_s;
    device::DeviceState state;
    state.time = i * realtime::fixture::kTick;
    state.position_m = hip_;
    state.velocity_m_per_s = velocity_;
    renderer_.step(stage_.at(i), state, state.time, realtime::fixture::kTick, rendering_);
    if (i > 0) reference_.moveTo(i);
    bringInFrontOfFaces();
    ++verdict_.ticks;
    verdict_.touching += rendering_.touching ? 1 : 0;
    verdict_.limited += renderer_.energyShare() < 1 ? 1 : 0;
    judgeNumbers();
    if (verdict_.finding) return;
    judgePlaces();
    if (static_ && !oneSidedBall_) judgeEnergy();
    const bool last = static_cast<std::size_t>(i) + 1 == trial_.hips.size();
    const bool judgeable = rendering_.touching && !oneSidedBall_ && (rendering_.status & kUnfinished) == 0;
    if (judgeable && (options_.longRulesAtTheEnd ? last : drawn(options_.share))) return judgeAtLength();
    // Where a proxy stuck, it is in the same place as before.
    if (judgeable && heldFast() && (options_.longRulesAtTheEnd ? last : drawn(20 * options_.share)))
      judgeRest();
  }

  // Where very many triangles meet, the renderer may move the surface by this much (decision 29), in two
  // neighbouring gathers by different amounts. A point tool is a ball of half the gap tolerance.
  double joinedError() const {
    return trial_.kind == "joined" ? 0.1e-6 + 5e-4 * std::max(trial_.toolRadius_m, 0.5 * kGap_m) : 0.0;
  }

  // The proxy of a point tool may be behind a face by that much, and by no more. It is judged in front of the
  // faces that it is on: on the side to which its spring pushes the hand, and without a spring on the side
  // where it was. A ball's proxy is its centre, far from the faces that hold it; a centre beside a face came
  // from behind.
  void bringInFrontOfFaces() {
    constexpr int kRounds = 20;
    broughtBy_ = Point::Zero();
    if (joinedError() == 0 || trial_.toolRadius_m > 0) return;
    const Point& p = rendering_.proxy_m;
    const double farthest = 2 * joinedError();
    const Point spring = p - hip_;
    const bool pushed = rendering_.touching && spring.norm() > reference_.rounding();
    const int nearest = nearestFace(p, 5 * farthest);
    const double before = nearest >= 0 && !pushed ? sideBefore() : 0.0;
    if (nearest < 0 || (!pushed && before == 0)) return;
    const auto towardsFront = [&](const Face& f) {
      return (pushed ? f.normal.dot(spring) : before) < 0 ? Point(-f.normal) : f.normal;
    };
    const Face& f = reference_.face(nearest);
    const bool behind = towardsFront(f).dot(p - f.a) < 0;
    if (behind && (nearestOf(f, p) - p).norm() > joinedError()) return;
    if (!behind && !rendering_.touching) return;
    std::vector<Point> normals;
    for (const int i : reference_.near(p, 5 * farthest)) normals.push_back(towardsFront(reference_.face(i)));
    for (int round = 0; round < kRounds; ++round) {
      for (const Point& n : normals) broughtBy_ += std::max(0.0, farthest - n.dot(broughtBy_)) * n;
    }
    rendering_.proxy_m += broughtBy_;
  }

  // -1: none within this distance.
  int nearestFace(const Point& p, double distance) const {
    int nearest = -1;
    for (const int i : reference_.near(p, distance)) {
      const double d = (nearestOf(reference_.face(i), p) - p).norm();
      if (d > distance) continue;
      distance = d;
      nearest = i;
    }
    return nearest;
  }

  // The side of the faces where the proxy was in the tick before, 1 in front, -1 behind; 0 beside their rim.
  // Faces that are joined have the same winding.
  double sideBefore() const {
    const int i = nearestFace(proxyBefore_, (rendering_.proxy_m - proxyBefore_).norm() + joinedError());
    if (i < 0) return 0;
    const Face& f = reference_.face(i);
    const double height = f.normal.dot(proxyBefore_ - f.a);
    if (std::abs(height) < 0.5 * (nearestOf(f, proxyBefore_) - proxyBefore_).norm()) return 0;
    return height < 0 ? -1 : 1;
  }

  // At random, with this probability; the same in every run of the trial.
  bool drawn(double probability) const {
    return static_cast<double>(mixed(trial_.seed, static_cast<std::uint64_t>(tick_)) >> 11U) * 0x1p-53 <
           probability;
  }
  bool heldFast() const {
    const double way = (hip_ - hipBefore_).norm();
    return way > kGap_m && (rendering_.proxy_m - proxyBefore_).norm() < 0.02 * way;
  }

  // What the report alone shows.
  void judgeNumbers() {
    const Rendering& r = rendering_;
    if (!r.force_N.allFinite() || !r.proxy_m.allFinite() || !r.contactForce_N.allFinite())
      return report("finite", "");
    if ((r.status & kUnexpected) != 0) return report("status", "bits ", r.status);
    Point sum = Point::Zero();
    for (std::uint32_t k = 0; k < r.contactCount; ++k) sum += r.contacts[k].force_N;
    if ((sum - r.contactForce_N).norm() > 1e-9 * (1 + r.contactForce_N.norm())) {
      return report("fields", "the contacts sum to ", sum.transpose(), " instead of ",
                    r.contactForce_N.transpose());
    }
    if (trial_.kind == "joined" && (r.status & realtime::kRenderWorkLimit) != 0)
      return report("work", "spent");
    if (r.touching != (r.contactCount > 0))
      return report("fields", "touching ", r.touching, ", contacts ", r.contactCount);
    if (!r.touching && (r.depth_m != 0 || !r.contactForce_N.isZero(0))) {
      return report("fields", "depth ", r.depth_m, " and force ", r.contactForce_N.norm(),
                    " without contact");
    }
    const double spring = (r.proxy_m - hip_).norm();
    if (r.touching && r.depth_m == 0 && spring > kForceTolerance_m && (r.status & kUnfinished) == 0) {
      return report("fields", "depth 0 in contact, with the proxy ", spring, " m from the HIP");
    }
    if (r.touching && !(std::abs(r.normal.norm() - 1) < 1e-9))
      return report("fields", "a normal of length ", r.normal.norm());
    const double bound = stiffest_ * (spring * (1 + 1e-6) + kForceTolerance_m) * (1 + friction_) +
                         3 * damping_ * (velocity_.norm() + surfaceSpeed()) * (1 + friction_);
    if (!(r.contactForce_N.norm() <= bound)) {
      return report("force", r.contactForce_N.norm(), " N with the proxy ", spring,
                    " m from the HIP; at most ", bound, " N");
    }
    const double share = renderer_.energyShare();
    // In slits narrower than the ball of a point, the proxy is where there is room.
    const bool slits = trial_.kind == "sheets" || trial_.kind == "soup" || trial_.kind == "joined";
    const bool simple = static_ && !slits && !mixedStiffness() && trial_.toolRadius_m == 0;
    if (!(share > 0 && share <= 1) || (simple && share < 0.8)) report("share", share, " of the springs acts");
  }

  double surfaceSpeed() const {
    double fastest = 0;
    for (std::size_t i = 0; i < trial_.objects.size() && reference_.moved(); ++i) {
      fastest = std::max(
          fastest, (reference_.carriedByObject(proxyBefore_, static_cast<int>(i)) - proxyBefore_).norm());
      if (!trial_.objects[i].target.empty()) fastest = std::max(fastest, 1e-3);  // the fastest deformation
    }
    return fastest / kPeriod_s;
  }

  double beyondWalls(const Point& p) const {
    double farthest = -std::numeric_limits<double>::infinity();
    for (const Wall& wall : trial_.enclosure)
      farthest = std::max(farthest, wall.normal.dot(p) - wall.offset_m);
    return farthest;
  }

  void judgePlaces() {
    const Point& p = rendering_.proxy_m;
    reported_.push_back({p, (rendering_.status & realtime::kRenderPopthrough) != 0, hip_});
    rounding_ = reference_.rounding();
    if (beyondWalls(p) > kGap_m)
      return report("escaped", beyondWalls(p), " m beyond a wall, proxy ", p.transpose());
    const double spring = (p - hip_).norm();
    const bool unfinished = (rendering_.status & kUnfinished) != 0;
    const double away = (p - broughtBy_ - hip_).norm();
    if (!rendering_.touching && away > rounding_ && (touchedBefore_ || !unfinished) && !touchesAsBall(away)) {
      return report("lost", "no contact, and the proxy is ", away, " m from the HIP");
    }
    // Frictionless, the place of the tick before was free and nearer.
    const double now = spring;
    const double before = (proxyBefore_ - hip_).norm();
    const bool popped = (rendering_.status & realtime::kRenderPopthrough) != 0;
    if (static_ && friction_ == 0 && tick_ > 0 && !popped &&
        now > before + kGap_m + 2e-3 * trial_.toolRadius_m && !unfinished && !oneSidedBall_ && !pops_ &&
        !(now < before + kWedge_m && inWedge()) && !leftSlit()) {
      return report("climbed", "the proxy moved from ", before, " m to ", now, " m from the HIP");
    }
    reference_.heights(p, proxyHeights_);
    if (tick_ > 0 && !popped) judgePassage();
    rememberSides();
    heightsBefore_.swap(proxyHeights_);
    if (rendering_.contactForce_N.norm() > stiffest_ * kForceTolerance_m + damping_ * velocity_.norm())
      judgeFreeForce();
    if (rendering_.touching) touchedAt_ = p;
  }

  // A HIP that is free within the ball of the point tool: where the work of the tick ends, the report is
  // still the ball, and where two faces meet within rounding, the HIP may be behind one that the ball does
  // not touch.
  bool touchesAsBall(double away) const {
    if (trial_.toolRadius_m > 0 || away > 0.5 * kGap_m) return false;
    if ((rendering_.status & realtime::kRenderWorkLimit) != 0) return true;
    const std::vector<int> near = reference_.near(hip_, kGap_m);
    return near.size() > 1 && std::any_of(near.begin(), near.end(), [&](int i) {
             return reference_.crosses(i, rendering_.proxy_m, hip_, 0);
           });
  }

  // Where faces meet at an acute angle, the ball of the point tool does not reach as far as the reported
  // proxy.
  bool inWedge() const {
    return trial_.toolRadius_m == 0 && (reference_.near(proxyBefore_, kTouch_m).size() > 1 ||
                                        reference_.near(rendering_.proxy_m, kTouch_m).size() > 1);
  }

  // Between faces that leave the ball of a point tool no room, the HIP came from behind or past their rims,
  // and the ball is where there is room, up to millimetres away. While the HIP is in front of all of them it
  // is free, and the report is the HIP; with a force, the report is at the ball.
  bool leftSlit() const {
    if (trial_.toolRadius_m > 0 || touchedBefore_ || !rendering_.touching) return false;
    FreeSpace space(reference_, proxyBefore_, kWedge_m, kFollower_m,
                    trial_.seed + static_cast<std::uint64_t>(tick_));
    const auto visible = [&](const Point& q) {
      return std::none_of(space.faces().begin(), space.faces().end(),
                          [&](int i) { return reference_.crosses(i, proxyBefore_, q, 0); });
    };
    return !space.placeNear(proxyBefore_, visible) || remainedInSlit();
  }

  // Where there is room beside the HIP, but the slit narrows towards it: from its last place in contact, the
  // ball does not get to the free HIP, and it is there, or nearer, when it is reported again.
  bool remainedInSlit() const {
    Descent descent(reference_, touchedAt_, 2 * (proxyBefore_ - touchedAt_).norm() + 400e-6, kRolling_m,
                    trial_.seed);
    const Point ball = descent.from(touchedAt_, proxyBefore_, 200);
    return (ball - proxyBefore_).norm() > kWedge_m &&
           (rendering_.proxy_m - hip_).norm() < (ball - hip_).norm() + kWedge_m;
  }

  // A move is suspected when it goes through a face, or past its edge nearer than any gap is wide.
  void judgePassage() {
    const auto n = static_cast<int>(reference_.faces().size());
    suspects_.clear();
    byMemory_ = false;
    for (int i = 0; i < n; ++i) {
      if (!reference_.moved() && std::abs(heightsBefore_[i]) > rounding_) {
        if ((heightsBefore_[i] >= 0) == (proxyHeights_[i] >= 0)) continue;
      }
      if (reference_.face(i).thin) continue;
      if (reference_.crosses(i, previousPlace(i), rendering_.proxy_m, kSuspect_m)) suspects_.push_back(i);
    }
    if (suspects_.empty()) return;
    ++verdict_.suspected;
    if (static_ && !touchedBefore_ && !rendering_.touching) judgeFreeMove();
    if (verdict_.finding || passageFound()) return;
    // On the plane of a face, within rounding, the proxy may still be on the side where it was seen last,
    // where it last was off the plane, or where rounding put it.
    byMemory_ = true;
    if (passageFound() || roomCloses()) return;
    const Eigen::ArrayXd sides = sides_;
    sides_ = seen_;
    if (passageFound()) {
      sides_ = sides;
      return;
    }
    byMemory_ = false;
    sides_ =
        (heightsBefore_ >= 0).select(Eigen::ArrayXd::Ones(sides.size()), -Eigen::ArrayXd::Ones(sides.size()));
    if (passageFound()) return;
    sides_ = sides;
    byMemory_ = fromBehind_ = trial_.sides != Sides::both && trial_.toolRadius_m == 0;
    const bool found = fromBehind_ && passageFound();
    fromBehind_ = false;
    if (found) return;
    if (follows(trial_, reported_, kFollower_m)) return;
    const Face& f = reference_.face(suspects_.front());
    report("through", "from ", proxyBefore_.transpose(), " to ", rendering_.proxy_m.transpose(),
           " past face ", suspects_.front(), " of object ", f.object, ", force ",
           rendering_.contactForce_N.norm());
  }

  // The sides of the faces on which the proxy is now, and on which it was last seen off their planes.
  void rememberSides() {
    if (sides_.size() == 0) sides_ = seen_ = Eigen::ArrayXd::Zero(proxyHeights_.size());
    for (Eigen::Index i = 0; i < sides_.size(); ++i) {
      const bool on = reference_.onPlane(reference_.face(static_cast<int>(i)), rendering_.proxy_m);
      const double side = proxyHeights_[i] >= 0 ? 1 : -1;
      const bool keep = byMemory_ && sides_[i] != 0 && on;
      if (!keep) sides_[i] = side;
      if (!on) seen_[i] = side;
    }
  }

  // From free motion to free motion, through the inside of a face that is alone and lies below the HIP: it
  // must have held the proxy, however near a way around is.
  void judgeFreeMove() {
    for (const int i : suspects_) {
      const Face& f = reference_.face(i);
      const Point foot = nearestOf(f, hip_);
      // By a gap's width inside: at its rim the proxy may slide off.
      const bool below = reference_.pierces(i, foot + (foot - hip_), hip_, -kGap_m) &&
                         (hip_ - foot).cross(f.normal).norm() < 1e-9;
      if (!below || !reference_.crosses(i, proxyBefore_, hip_, -kGap_m)) continue;
      if (reference_.near(0.5 * (proxyBefore_ + hip_), (hip_ - proxyBefore_).norm() + trial_.toolRadius_m)
              .size() > 1)
        continue;
      return report("through", "from ", proxyBefore_.transpose(), " to ", hip_.transpose(), " through face ",
                    i, ", alone");
    }
  }

  // Where the proxy was, relative to a face: from its plane, within rounding, lifted to the side where it
  // was.
  Point previousPlace(int i) const {
    return lifted(i, reference_.moved() ? reference_.carried(proxyBefore_, i) : proxyBefore_);
  }
  Point presentPlace(int i) const {
    return byMemory_ ? lifted(i, rendering_.proxy_m) : Point(rendering_.proxy_m);
  }
  Point lifted(int i, const Point& p) const {
    const Face& f = reference_.face(i);
    if (!reference_.onPlane(f, p)) return p;
    const double height = std::abs(f.normal.dot(p - f.a));
    return p + std::max(2 * kOnPlane * rounding_, kOnPlane * rounding_ + height) * sides_[i] * f.normal;
  }
  // The follower: from the proxy's place before, carried with each face, to its place now.
  bool passageFound() {
    const Point& p = rendering_.proxy_m;
    double way = (p - proxyBefore_).norm();
    for (const int i : suspects_) way = std::max(way, (p - previousPlace(i)).norm());
    bool decided = false;
    for (const double reach : {1.0 * way + 100e-6, 5 * way + 400e-6}) {
      FreeSpace space(reference_, 0.5 * (p + proxyBefore_), reach, kFollower_m,
                      trial_.seed + static_cast<std::uint64_t>(tick_));
      const std::optional<Point> start = placeBefore(space);
      const std::optional<Point> end = placeNow(space);
      if (!start || !end) continue;
      decided = true;
      if (space.connects(*start, *end)) return true;
    }
    if (!decided) ++verdict_.undecided;
    return !decided;
  }

  // An object may keep the proxy behind a plane, which then holds it where it is.
  static bool isBehind(const TrialPlane& plane, const Point& p) {
    return plane.normal.dot(p) + plane.offset_m < -kSuspect_m;
  }

  // Where the proxy's room is narrower than the way of its walls in this tick: nothing keeps a proxy in a
  // room that closes. It has closed where objects have pushed the proxy into the solid of a plane.
  bool roomCloses() {
    if (!reference_.moved()) return false;
    if (std::any_of(trial_.planes.begin(), trial_.planes.end(),
                    [&](const TrialPlane& plane) { return isBehind(plane, proxyBefore_); })) {
      ++verdict_.undecided;
      return true;
    }
    double way = 0;
    std::vector<int> walls = reference_.near(rendering_.proxy_m, kTouch_m);
    walls.insert(walls.end(), suspects_.begin(), suspects_.end());
    for (const int i : walls) way = std::max(way, (proxyBefore_ - previousPlace(i)).norm());
    FreeSpace space(reference_, proxyBefore_, 5 * way + 400e-6, kFollower_m + way,
                    trial_.seed + static_cast<std::uint64_t>(tick_));
    if (placeBefore(space, {kSuspect_m})) return false;
    ++verdict_.undecided;
    return true;
  }

  std::optional<Point> placeBefore(FreeSpace& space,
                                   std::initializer_list<double> widenings = {kSuspect_m, 0}) const {
    for (const double widening : widenings) {
      const auto visible = [&](const Point& q) {
        return std::none_of(space.faces().begin(), space.faces().end(), [&](int i) {
          return reference_.pierces(i, previousPlace(i), q, widening) && !touchesFromBehind(i, q);
        });
      };
      for (const int i : suspects_) {
        const Point base = previousPlace(i);
        if (const auto place = space.placeNear(base, visible)) return place;
        if (!reference_.moved()) break;
      }
    }
    return std::nullopt;
  }

  // The point tool touches as a ball, and its proxy is reported on the faces that hold it. A one-sided face
  // between the two, which does not hold it, has let the ball's surface through from behind, and not yet the
  // ball.
  bool touchesFromBehind(int i, const Point& ball) const {
    const Face& f = reference_.face(i);
    const Point p = reference_.moved() ? reference_.carried(proxyBefore_, i) : proxyBefore_;
    return fromBehind_ && !f.unbounded && !reference_.onPlane(f, p) &&
           (ball - p).norm() <= 2.5 * kFollower_m && !reference_.touchableFrom(f, f.normal.dot(ball - f.a));
  }

  std::optional<Point> placeNow(FreeSpace& space) const {
    for (const double widening : {kSuspect_m, 0.0}) {
      const auto visible = [&](const Point& q) {
        return std::none_of(space.faces().begin(), space.faces().end(),
                            [&](int i) { return reference_.pierces(i, q, presentPlace(i), widening); });
      };
      if (const auto place = space.placeNear(rendering_.proxy_m, visible)) return place;
    }
    return std::nullopt;
  }

  void judgeFreeForce() {
    const Point& p = rendering_.proxy_m;
    const Point way = hip_ - p;
    if (way.norm() < 60e-6) return;
    // In a wedge, the ball of a point tool is farther from the faces that hold it, and the proxy on their
    // planes.
    const double radius = trial_.toolRadius_m;
    const bool wedge = radius == 0 && reference_.near(p, kWedge_m).size() > 1;
    const Point start_m = wedge ? Point(p - 0.5 * kGap_m * way.normalized()) : p;
    // Cheap: a face on the way.
    reference_.heights(hip_, hipHeights_);
    const double margin = radius + 1.5e-6;
    for (Eigen::Index i = 0; i < hipHeights_.size(); ++i) {
      const double start = heightsBefore_[i];  // of the proxy: swapped above
      const double end = hipHeights_[i];
      // An object may keep the proxy behind a plane.
      if (reference_.face(static_cast<int>(i)).unbounded && end < 0) return;
      if (std::min(start, end) > margin || std::max(start, end) < -margin) continue;
      if (radius == 0 &&
          reference_.crosses(static_cast<int>(i), start_m, hip_, wedge ? kWedge_m : 1.2 * kGap_m))
        return;
      if (radius > 0 && distanceOf(reference_.face(static_cast<int>(i)), p, hip_) < radius + 1e-6) {
        if (leavesFace(static_cast<int>(i), p)) continue;
        return;
      }
    }
    // Edges near a point may hold it.
    const Point off = p + way * std::min(1.0, 30e-6 / way.norm());
    for (Eigen::Index i = 0; radius == 0 && i < hipHeights_.size(); ++i) {
      if (std::min(heightsBefore_[i], hipHeights_[i]) > kTouch_m ||
          std::max(heightsBefore_[i], hipHeights_[i]) < -kTouch_m)
        continue;
      if (distanceOf(reference_.face(static_cast<int>(i)), off, hip_) < kTouch_m) return;
    }
    if (static_ && balances()) return;
    report("free", rendering_.contactForce_N.norm(), " N, and the way from the proxy ", p.transpose(),
           " to the HIP ", hip_.transpose(), " is free");
  }

  // A ball that rests on a face and is pulled off it.
  bool leavesFace(int i, const Point& p) const {
    const Face& f = reference_.face(i);
    const Point away = p - nearestOf(f, p);
    return away.dot(hip_ - p) > 1e-3 * away.norm() * (hip_ - p).norm() &&
           (hip_ - nearestOf(f, hip_)).norm() > trial_.toolRadius_m;
  }

  double energyAllowance() const { return 1e-9 + stiffest_ * kForceTolerance_m * kForceTolerance_m; }

  void judgeEnergy() {
    work_.add(rendering_, renderer_.energyShare(), hip_, stiffest_);
    if (work_.surplus() > energyAllowance()) {
      const Work whole = work_;
      if (refineWork() > energyAllowance()) {
        return report("energy", "the hand gained ", whole.gained_J, " J; the error of the sum is at most ",
                      whole.error_J, " J; in parts of a tick ", work_.gained_J, " and ", work_.error_J);
      }
    }
    if (rendering_.touching) return;
    work_.endContact();
    freeTick_ = tick_;
  }

  // The sum knows nothing of a force that turns within a tick, as on a fast way around an edge. The same way
  // in parts of a tick, since the hand was last free; returns the largest surplus. What the hand gained only
  // because ticks are long is no gain there.
  double refineWork() {
    constexpr int kParts = 16;
    Stage stage(trial_);
    realtime::Renderer renderer({trial_.toolRadius_m, false});
    Rendering r;
    device::DeviceState state;
    Work work;
    double surplus = 0;
    for (int i = 0; i <= tick_; ++i) {
      const Point& to = trial_.hips[static_cast<std::size_t>(i)];
      const Point from = i > 0 ? trial_.hips[static_cast<std::size_t>(i - 1)] : to;
      const int parts = i > freeTick_ ? kParts : 1;
      const base::Nanos part = realtime::fixture::kTick / parts;
      for (int k = 1; k <= parts; ++k) {
        state.time = i * realtime::fixture::kTick - (parts - k) * part;
        state.position_m = from + static_cast<double>(k) / parts * (to - from);
        state.velocity_m_per_s = (to - from) / kPeriod_s;
        renderer.step(stage.at(i), state, state.time, part, r);
        work.add(r, renderer.energyShare(), state.position_m, stiffest_);
        if (i > freeTick_) surplus = std::max(surplus, work.surplus());
        if (!r.touching) work.endContact();
      }
    }
    work_.gained_J = work.gained_J;
    work_.error_J = work.error_J;
    return surplus;
  }

  void judgeAtLength() {
    ++verdict_.longRules;
    const double radius = trial_.toolRadius_m;
    const std::vector<int> near = reference_.near(rendering_.proxy_m, radius + kTouch_m);
    judgeDirection(withWedges(near));
    judgeLaw(near);
    if (radius > 0 && trial_.sides == Sides::both && !pops_) judgeOverlap(near);
    judgeRest();
  }

  // In a wedge of the angle a, the ball of a point tool, of radius R, touches the walls R / tan(a / 2) from
  // where their planes meet, and the reported proxy may be there: below 22.6 degrees farther than kTouch_m.
  // Adds the walls of each ball from which the proxy may be reported.
  std::vector<int> withWedges(const std::vector<int>& near) const {
    if (trial_.toolRadius_m > 0) return near;
    std::vector<int> all = near;
    const std::vector<int> walls = reference_.near(rendering_.proxy_m, kWedge_m);
    const auto isNear = [&](int i) { return std::find(near.begin(), near.end(), i) != near.end(); };
    for (const int i : walls) {
      for (const int k : walls) {
        if (i >= k || (isNear(i) && isNear(k)) || !holdBall(i, k, walls)) continue;
        all.insert(all.end(), {i, k});
      }
    }
    return all;
  }

  // Whether a ball rests between two faces, overlaps no other, and sees the proxy, which is on its straight
  // way to where the planes of both meet: equally high above them.
  bool holdBall(int i, int k, const std::vector<int>& others) const {
    constexpr double kAcute = -0.923;  // cosine of two normals at 22.6 degrees
    constexpr double kRadius_m = 0.5 * kGap_m;
    const Point& p = rendering_.proxy_m;
    const Point m = normalAt(reference_.face(i));
    const Point n = normalAt(reference_.face(k));
    if (m.dot(n) > kAcute || 1 + m.dot(n) < 1e-6) return false;
    const double height = m.dot(p - reference_.face(i).a);
    const double slack = kOnPlane * reference_.rounding();
    if (std::abs(height - n.dot(p - reference_.face(k).a)) > slack) return false;
    const Point ball = p + (kRadius_m - height) / (1 + m.dot(n)) * (m + n);
    const auto distance = [&](int face) { return (nearestOf(reference_.face(face), ball) - ball).norm(); };
    if ((ball - p).norm() > kWedge_m || std::max(distance(i), distance(k)) > kRadius_m + slack) return false;
    return seesProxy(ball, others) && std::none_of(others.begin(), others.end(), [&](int other) {
             const Face& f = reference_.face(other);
             return reference_.touchableFrom(f, f.normal.dot(ball - f.a)) &&
                    distance(other) < kRadius_m - slack;
           });
  }

  Point normalAt(const Face& f) const {
    const Point& p = rendering_.proxy_m;
    if (trial_.toolRadius_m > 0) return (p - nearestOf(f, p)).stableNormalized();
    return f.normal.dot(p - f.a) < 0 && !f.unbounded ? Point(-f.normal) : f.normal;
  }

  bool mixedStiffness() const {
    const auto other = [&](const auto& o) { return o.material.stiffness_N_per_m != stiffest_; };
    return std::any_of(trial_.objects.begin(), trial_.objects.end(), other) ||
           std::any_of(trial_.planes.begin(), trial_.planes.end(), other);
  }

  // A one-sided face does not hold a ball that is behind it: it is on the side to which the force pushes.
  bool passedFromBehind(const Face& f) const {
    const Point ball = rendering_.proxy_m + 0.5 * kGap_m * rendering_.normalForce_N.stableNormalized();
    return !f.unbounded && !reference_.touchableFrom(f, f.normal.dot(ball - f.a));
  }

  // A point is a ball of the gap's radius, and friction holds it on the round of a rim. There the surface
  // turns from the normal of the face to the outward direction in its plane. A rim: no other face goes on
  // beyond it.
  std::vector<Point> rimsOf(const Face& f, const std::vector<int>& near) const {
    std::vector<Point> rims;
    const Point& p = rendering_.proxy_m;
    const std::array<Point, 3> corners{f.a, f.b, f.c};
    for (std::size_t k = 0; k < 3 && !f.unbounded && trial_.toolRadius_m == 0; ++k) {
      const Point along = (corners[(k + 1) % 3] - corners[k]).stableNormalized();
      const Point outward = along.cross(f.normal);
      if (std::abs(outward.dot(p - corners[k])) > kGap_m) continue;
      const Point beyond = p + 2 * kGap_m * outward;
      const auto goesOn = [&](int i) {
        const Face& other = reference_.face(i);
        if ((other.a == f.a && other.b == f.b && other.c == f.c) || passedFromBehind(other)) return false;
        return outward.dot(normalAt(other)) < -1e-6 ||
               (nearestOf(other, beyond) - beyond).norm() < 1.5 * kGap_m;
      };
      if (std::none_of(near.begin(), near.end(), goesOn)) rims.push_back(outward);
    }
    return rims;
  }

  // Directions in the plane of a face in which no face goes on, beside a point: at a corner or in a notch.
  std::vector<Point> openDirections(const Face& f, const std::vector<int>& near) const {
    std::vector<Point> open;
    if (f.unbounded || trial_.toolRadius_m > 0 || friction_ == 0) return open;
    const Point& p = rendering_.proxy_m;
    if ((p - nearestOf(f, p)).norm() > kGap_m) return open;
    const Point u = (f.b - f.a).stableNormalized();
    const Point v = f.normal.cross(u);
    for (int k = 0; k < 16; ++k) {
      const double angle = k * M_PI / 8;
      const Point way = std::cos(angle) * u + std::sin(angle) * v;
      const Point beyond = p + 2 * kGap_m * way;
      const auto covers = [&](int i) {
        return !passedFromBehind(reference_.face(i)) &&
               (nearestOf(reference_.face(i), beyond) - beyond).norm() < 0.3 * kGap_m;
      };
      if (std::none_of(near.begin(), near.end(), covers)) open.push_back(way);
    }
    return open;
  }

  // A ball of the gap's radius that touches an edge of a face, turned around that edge: from the normal of
  // the face (0) to the outward direction in its plane (pi / 2).
  struct Round {
    const Face* face = nullptr;
    Point foot = Point::Zero();
    Point normal = Point::Zero();
    Point outward = Point::Zero();

    Point direction(double angle) const { return std::cos(angle) * normal + std::sin(angle) * outward; }
    Point centre(double angle) const { return foot + 0.5 * kGap_m * direction(angle); }
    bool isOf(const Face& f) const { return f.a == face->a && f.b == face->b && f.c == face->c; }
  };

  std::vector<Round> roundsOf(const Face& f) const {
    std::vector<Round> rounds;
    if (f.unbounded || trial_.toolRadius_m > 0) return rounds;
    const Point& p = rendering_.proxy_m;
    const std::array<Point, 3> corners{f.a, f.b, f.c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Point side = corners[(k + 1) % 3] - corners[k];
      const Point foot =
          corners[k] + std::clamp(side.dot(p - corners[k]) / side.squaredNorm(), 0.0, 1.0) * side;
      if ((p - foot).norm() > kGap_m) continue;
      rounds.push_back({&f, foot, normalAt(f), side.cross(f.normal).stableNormalized()});
    }
    return rounds;
  }

  // The ranges of angles, up to a quarter turn, in which the ball fits; `wanted`: how many.
  template <class Fits>
  static std::vector<std::array<double, 2>> rangesWhere(const Fits& fits, std::size_t wanted) {
    constexpr int kParts = 90;
    constexpr int kHalvings = 20;
    const auto limit = [&](double fitting, double other) {
      for (int i = 0; i < kHalvings; ++i) {
        const double middle = 0.5 * (fitting + other);
        (fits(middle) ? fitting : other) = middle;
      }
      return fitting;
    };
    std::vector<std::array<double, 2>> ranges;
    double before = 0;
    bool fitted = false;
    for (int k = 0; k <= kParts; ++k) {
      const double angle = 0.5 * M_PI * k / kParts;
      const bool fitting = fits(angle);
      if (fitting && !fitted) ranges.push_back({k == 0 ? 0 : limit(angle, before), angle});
      if (fitting) ranges.back()[1] = angle;
      if (!fitting && fitted) ranges.back()[1] = limit(before, angle);
      if (!fitting && ranges.size() == wanted) break;
      before = angle;
      fitted = fitting;
    }
    return ranges;
  }

  // A point is a ball of the gap's radius. Where two faces meet without a shared edge, it sinks between them
  // or rests on the step from one to the other: it rolls around the edge of a face until it meets another
  // one. Up to there the surface turns from the normal of the face to the outward direction. The renderer
  // keeps the ball off a face by 1e-9 of the largest coordinate of its object: steps of this height count, 1
  // nm is 1.1 degrees.
  //
  // Where another face is so near that the ball does not fit above this one, it may be in the mouth of the
  // slit: it rolled in from beside the edge until it met the other face. It is there only if it fits and sees
  // the proxy, on a side of this face that can be touched.
  void addSeams(const Face& f, const std::vector<int>& near, std::vector<Point>& normals) const {
    constexpr double kSkin = 1e-9;
    constexpr double kBeside = 0.5 * M_PI;
    constexpr std::size_t kRanges = 3;
    double farthest = 0;
    for (const Face& g : reference_.faces()) {
      if (!g.unbounded)
        farthest = std::max(
            {farthest, g.a.cwiseAbs().maxCoeff(), g.b.cwiseAbs().maxCoeff(), g.c.cwiseAbs().maxCoeff()});
    }
    const double least = 0.5 * kGap_m - kSkin * farthest;
    for (const Round& round : roundsOf(f)) {
      const auto overlapsNone = [&](const Point& centre, const auto& passed) {
        return std::none_of(near.begin(), near.end(), [&](int i) {
          const Face& other = reference_.face(i);
          return !round.isOf(other) && !passed(other) && (centre - nearestOf(other, centre)).norm() < least;
        });
      };
      const auto fitsAbove = [&](double angle) {
        return overlapsNone(round.centre(angle), [&](const Face& other) { return passedFromBehind(other); });
      };
      const double last = fitsAbove(0) ? rangesWhere(fitsAbove, 1)[0][1] : 0.0;
      if (last > 0) normals.push_back(round.direction(last));
      if (last == kBeside) continue;
      const auto fitsBeside = [&](double angle) {
        const Point centre = round.centre(angle);
        const auto passed = [&](const Face& other) {
          return !reference_.touchableFrom(other, other.normal.dot(centre - other.a));
        };
        return !passed(f) && overlapsNone(centre, passed) && seesProxy(centre, near);
      };
      for (const auto& range : rangesWhere(fitsBeside, kRanges)) {
        for (const double end : range) normals.push_back(round.direction(end));
      }
    }
  }

  bool seesProxy(const Point& ball, const std::vector<int>& near) const {
    return std::none_of(near.begin(), near.end(),
                        [&](int i) { return reference_.pierces(i, ball, rendering_.proxy_m, 0); });
  }

  void judgeDirection(const std::vector<int>& near) {
    if (mixedStiffness()) return;  // blending adds a tangential part
    const Point& force = rendering_.normalForce_N;
    std::vector<Point> normals;
    std::vector<Point> seams;
    for (const int i : near) {
      const Point n = normalAt(reference_.face(i));
      const auto same = [&](const Point& m) { return (m - n).squaredNorm() < 1e-18; };
      if (std::none_of(normals.begin(), normals.end(), same)) normals.push_back(n);
      const std::vector<Point> open = openDirections(reference_.face(i), near);
      if (!open.empty()) {
        normals.insert(normals.end(), open.begin(), open.end());
        if (trial_.sides == Sides::both) normals.push_back(-n);
      }
      addSeams(reference_.face(i), near, seams);
      for (const Point& rim : rimsOf(reference_.face(i), near)) {
        normals.push_back(rim);
        if (trial_.sides == Sides::both) normals.push_back(-n);
      }
      if (normals.size() >= 24) return;  // the set is not worth its time
    }
    for (const TrialPlane& plane : trial_.planes) {
      if (isBehind(plane, rendering_.proxy_m)) normals.push_back(plane.normal);
    }
    normals.insert(normals.end(), seams.begin(), seams.end());
    const double off = distanceFromCone(force, normals);
    if (off > 2e-3 * force.norm() + stiffest_ * kForceTolerance_m) {
      report("direction", "the force ", force.transpose(), " is off the cone of ", normals.size(),
             " normals by ", off, " N");
    }
  }

  void judgeLaw(const std::vector<int>& near) {
    if (near.empty() || (damping_ > 0 && !static_)) return;
    const Point n = normalAt(reference_.face(near[0]));
    const Face& f = reference_.face(near[0]);
    for (const int i : near) {
      if (reference_.face(i).object != f.object || (normalAt(reference_.face(i)) - n).norm() > 1e-9) return;
    }
    // With unequal neighbours near, the stiffness is blended.
    if (mixedStiffness() && othersNear(f.object)) return;
    const auto hasRim = [&](int i) { return !rimsOf(reference_.face(i), near).empty(); };
    if (std::any_of(near.begin(), near.end(), hasRim)) return;
    const Material& m = reference_.materialOf(near[0]);
    const double depth = trial_.toolRadius_m - n.dot(hip_ - nearestOf(f, rendering_.proxy_m));
    // A face whose popthrough force is exceeded yields to a ball until that has room behind it.
    const double toRoom_N = m.stiffness_N_per_m * 2 * trial_.toolRadius_m;
    double spring_N = m.stiffness_N_per_m * std::max(0.0, depth);
    if (m.popthrough_N > 0 && m.popthrough_N < toRoom_N && spring_N > m.popthrough_N)
      spring_N = m.popthrough_N + std::max(0.0, spring_N - toRoom_N);
    const Point expected =
        renderer_.energyShare() * std::max(0.0, spring_N - m.damping_Ns_per_m * n.dot(velocity_)) * n;
    const double off = (rendering_.normalForce_N - expected).norm();
    if (off > (1e-6 + joinedTilt(f)) * expected.norm() + m.stiffness_N_per_m * kForceTolerance_m) {
      report("law", "the force ", rendering_.normalForce_N.transpose(), " on one surface, expected ",
             expected.transpose());
    }
  }

  // By how much a triangle that is joined from this face and its neighbours may be turned. On a round
  // surface, the planes at the ends of a chord are four times as far from each other as the chord is from the
  // surface, and turned twice as far as one of them is against it.
  double joinedTilt(const Face& f) const {
    if (joinedError() == 0) return 0;
    double farthest = 0;
    for (const Face& other : reference_.faces()) {
      const double height = other.normal.dot(rendering_.proxy_m - other.a);
      if (other.object == f.object && std::abs(height) <= 4 * joinedError())
        farthest = std::max(farthest, (other.normal - f.normal).norm());
    }
    return 0.5 * farthest;
  }

  bool othersNear(int object) const {
    const double blended = 1.2e-3 + 2 * (rendering_.proxy_m - hip_).norm() + trial_.toolRadius_m;
    const std::vector<int> near = reference_.near(rendering_.proxy_m, blended);
    return std::any_of(near.begin(), near.end(), [&](int i) { return reference_.face(i).object != object; });
  }

  void judgeOverlap(const std::vector<int>& near) {
    const double slack = 2e-6 + (static_ ? 0.0 : 1e-5) + joinedError();
    for (const int i : near) {
      const Face& f = reference_.face(i);
      const double distance = (rendering_.proxy_m - nearestOf(f, rendering_.proxy_m)).norm();
      if (distance < trial_.toolRadius_m - slack && !f.thin) {
        return report("overlap", "the ball is ", trial_.toolRadius_m - distance, " m in face ", i);
      }
    }
  }

  void judgeRest() {
    if (!static_ || friction_ > 0 || (rendering_.status & realtime::kRenderPopthrough) != 0) return;
    const Point& p = rendering_.proxy_m;
    const double radius = trial_.toolRadius_m;
    if ((p - hip_).norm() < kStuck_m) return;
    // One that popped through may overlap faces that leave it no room.
    if (pops_) return;
    // A ball converges on edges over several ticks: judged once it rests.
    if (radius > 0 && (p - proxyBefore_).norm() > kGap_m) return;
    Point better = p;
    if (radius > 0) {
      if (!nearerByRolling(p, radius, better)) return;
    } else {
      const Point push = rendering_.normalForce_N.stableNormalized();
      if (!nearerByRolling(p + kRolling_m * push, kRolling_m, better)) return;
      // One tick does not tell on which side of a gap the ball is, nor does its follower on faces that cross
      // or coincide: it is where the force pushes.
      if (secondOpinions_-- <= 0) return;
      std::vector<Point> balls = followers(trial_, reported_, kFollower_m);
      std::erase_if(balls, [&](const Point& q) { return !isPushedTo(q); });
      // A wider ball is not held by the same cages.
      const auto stuck = [&](const Point& q) {
        return nearerByRolling(q, kRolling_m, better) && nearerByRolling(q, kWider_m, better);
      };
      if (balls.empty() || !std::all_of(balls.begin(), balls.end(), stuck)) return;
    }
    if (balances()) return;
    report("stuck", "at ", p.transpose(), ", ", (p - hip_).norm(), " m from the HIP ", hip_.transpose(), "; ",
           better.transpose(), " is nearer");
  }

  // Whether the faces at the proxy give this force to a ball there. A ball behind a one-sided face that the
  // proxy is in front of may as well be in front of it: nothing is known of its room.
  bool isPushedTo(const Point& ball) const {
    std::vector<Point> normals;
    for (const int i : reference_.near(rendering_.proxy_m, kTouch_m)) {
      const Face& f = reference_.face(i);
      const double height = f.normal.dot(rendering_.proxy_m - f.a);
      if (reference_.touchableFrom(f, height) && !reference_.touchableFrom(f, f.normal.dot(ball - f.a)))
        return false;
      const bool behind = f.normal.dot(ball - f.a) < 0;
      if (behind && f.unbounded) return false;
      normals.emplace_back(behind ? Point(-f.normal) : f.normal);
    }
    const Point& force = rendering_.normalForce_N;
    return distanceFromCone(force, normals) <= 2e-3 * force.norm() + stiffest_ * kForceTolerance_m;
  }

  // Whether a ball could come nearer to the HIP from where it is nearest to the proxy, by more than is known
  // of its place.
  bool nearerByRolling(const Point& ball, double radius, Point& better) const {
    Descent descent(reference_, ball, kDescentReach_m, radius,
                    trial_.seed + static_cast<std::uint64_t>(tick_));
    const Point place = descent.from(ball, rendering_.proxy_m);
    better = descent.from(place, hip_);
    // Where a face begins below a nanometre above the one that the ball is on, its edge holds the ball; long
    // steps jump over it.
    Descent fine(reference_, place, kDescentReach_m, radius, trial_.seed, kFineSlack_m);
    if ((fine.from(place, hip_, 4, kFineStep_m) - place).norm() < 0.01 * kFineStep_m) return false;
    const double unknown = trial_.toolRadius_m > 0 ? 2e-3 * radius : kGap_m;
    return (place - hip_).norm() - (better - hip_).norm() > kStuck_m + unknown;
  }

  // With the HIP behind an edge that touches it, or in a cage that a small turn of the pull opens, a proxy
  // rests until the hand trembles.
  bool balances() const {
    std::mt19937_64 random(trial_.seed);
    std::normal_distribution<double> normal;
    Stage stage(trial_);
    realtime::Renderer renderer({trial_.toolRadius_m, false});
    Rendering r;
    device::DeviceState state;
    const double tremor = kTremor_m + kFlat * (rendering_.proxy_m - hip_).norm();
    for (int i = 0; i <= tick_ + kTremorTicks; ++i) {
      const Point& hip = trial_.hips[static_cast<std::size_t>(std::min(i, tick_))];
      const Point way(normal(random), normal(random), normal(random));
      state.time = i * realtime::fixture::kTick;
      state.position_m = i > tick_ ? Point(hip + tremor * way.normalized()) : hip;
      renderer.step(stage.at(i), state, state.time, realtime::fixture::kTick, r);
    }
    return (r.proxy_m - rendering_.proxy_m).norm() > kStuck_m + 3 * tremor;
  }

  const Trial& trial_;
  const RefereeOptions options_;
  Stage stage_;
  Reference reference_;
  realtime::Renderer renderer_;
  Verdict verdict_;
  bool touchedBefore_ = false;
  bool static_ = true;
  // Behind a one-sided face a ball may overlap it; the face pushes it out once its centre is in front. Rules
  // that rely on a ball beside the faces do not apply.
  bool oneSidedBall_ = false;
  // A ball that steps through a face may overlap others of that object, which then push it out.
  bool pops_ = false;
  double stiffest_ = 0;
  double damping_ = 0;
  double friction_ = 0;

  int secondOpinions_ = 5;  // they take long

  int tick_ = 0;
  Rendering rendering_;
  Point broughtBy_ = Point::Zero();  // the proxy of this tick, in front of the faces
  Point hip_ = Point::Zero();
  Point hipBefore_ = Point::Zero();
  Point velocity_ = Point::Zero();
  Point proxyBefore_ = Point::Zero();
  Point touchedAt_ = Point::Zero();  // by the proxy, last
  Work work_;
  int freeTick_ = 0;              // the last one without contact
  double rounding_ = 0;           // of float coordinates: no side is decided below it
  Eigen::ArrayXd heightsBefore_;  // of the proxy
  Eigen::ArrayXd sides_;          // of the faces, +-1, where the proxy was
  Eigen::ArrayXd seen_;           // the same, where it was last off their planes; 0: never
  bool fromBehind_ = false;       // the ball of a point tool may be behind one-sided faces
  bool byMemory_ = false;         // on the plane of a face, the proxy counts as on the side where it was
  Eigen::ArrayXd proxyHeights_;
  Eigen::ArrayXd hipHeights_;
  std::vector<int> suspects_;
  std::vector<ReportedProxy> reported_;  // in each tick
};

}  // namespace

Verdict judge(const Trial& trial, const RefereeOptions& options) {
  return Referee(trial, options).run();
}

}  // namespace hapticd::truth
