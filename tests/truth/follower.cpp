#include "truth/follower.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "truth/descent.h"

namespace hapticd::truth {
namespace {

constexpr double kFree = 4;        // radii around a proxy without faces: its place is that of the ball
constexpr std::size_t kEnds = 12;  // tried around the proxy, for each widening
constexpr double kFarthestEnd_m = 500e-6;
constexpr std::size_t kFollowers = 4;                          // where the place is not known
constexpr std::array<double, 3> kWidenings_m{30e-6, 5e-6, 0};  // of the faces between ball and proxy
constexpr double kFarthestBall_m = 60e-6;  // the reported proxy is at most 50 um from the ball that touches
constexpr double kRolling = 1.01;          // radii: a rolling ball may overlap faces by 2 nm
constexpr int kRolls = 3;                  // some of its directions are random
constexpr int kSteps = 200;                // of a roll
constexpr double kBehind =
    2.5;  // radii: a proxy nearer to the ball may be in front of a face that it is behind

void addOther(const Point& p, std::vector<Point>& places) {
  const auto same = [&](const Point& q) { return (p - q).norm() < 1e-9; };
  if (std::none_of(places.begin(), places.end(), same)) places.push_back(p);
}

class Follower {
 public:
  Follower(const Trial& trial, const std::vector<ReportedProxy>& proxies, double radius)
      : trial_(trial), reference_(trial), proxies_(proxies), radius_(radius), seed_(trial.seed) {}

  bool arrives() {
    const std::size_t start = lastFreeTick();
    reference_.moveTo(static_cast<int>(start));
    places_ = {proxies_[start].at};
    bool arrived = true;
    for (std::size_t tick = start + 1; tick < proxies_.size(); ++tick) {
      const Point& p = proxies_[tick].at;
      reference_.moveTo(static_cast<int>(tick));
      if (proxies_[tick].popped) {
        places_ = around(p);
        continue;
      }
      if (reference_.moved()) carry(p);
      arrived = moveTo(proxies_[tick]);
      // A way that only the first opinion found.
      if (!arrived && tick + 1 < proxies_.size()) places_ = around(p);
    }
    return arrived;
  }
  const std::vector<Point>& places() const { return places_; }

 private:
  // Before the last one. The first tick of a trial is free.
  std::size_t lastFreeTick() const {
    Reference reference(trial_);
    std::size_t last = 0;
    for (std::size_t tick = 0; tick + 1 < proxies_.size(); ++tick) {
      reference.moveTo(static_cast<int>(tick));
      if (reference.near(proxies_[tick].at, kFree * radius_).empty()) last = tick;
    }
    return last;
  }

  // A place that sees the proxy. On several faces, within rounding, it may be on either side of each; on one
  // alone it is where the renderer has put it.
  auto seesProxy(const FreeSpace& space, const Point& p, double widening) const {
    const auto holds = [&](int i) {
      const Face& f = reference_.face(i);
      return reference_.onPlane(f, p) && (nearestOf(f, p) - p).norm() < 2 * radius_;
    };
    const bool onSeveral = std::count_if(space.faces().begin(), space.faces().end(), holds) > 1;
    return [&space, &p, widening, onSeveral, this](const Point& q) {
      return std::none_of(space.faces().begin(), space.faces().end(), [&](int i) {
        return reference_.pierces(i, q, p, widening) &&
               !(onSeveral && reference_.onPlane(reference_.face(i), p)) && !passesFromBehind(i, q, p);
      });
    };
  }

  // A one-sided face has let the surface of the ball through from behind, and not yet its centre.
  bool passesFromBehind(int i, const Point& ball, const Point& p) const {
    const Face& f = reference_.face(i);
    return trial_.sides != Sides::both && !f.unbounded && (ball - p).norm() <= kBehind * radius_ &&
           !reference_.touchableFrom(f, f.normal.dot(ball - f.a));
  }

  // The followers where the proxy may be anywhere around its reported place.
  std::vector<Point> around(const Point& p) {
    FreeSpace space(reference_, p, 400e-6, radius_, seed_);
    for (const double widening : kWidenings_m) {
      const std::vector<Point> found = space.placesNear(p, seesProxy(space, p, widening), kFollowers);
      if (!found.empty()) return found;
    }
    return {};
  }

  // Each face takes along what it would pass. Where it finds no room, the place is not known.
  void carry(const Point& p) {
    std::vector<Point> carried;
    for (const Point& ball : places_) {
      std::vector<Point> bases{ball};
      for (std::size_t i = 0; i < reference_.faces().size(); ++i)
        addOther(reference_.carried(ball, static_cast<int>(i)), bases);
      double way = 0;
      for (const Point& base : bases) way = std::max(way, (base - ball).norm());
      FreeSpace space(reference_, ball, 5 * way + 400e-6, radius_, seed_);
      const auto passesNoFace = [&](const Point& q) {
        return std::none_of(space.faces().begin(), space.faces().end(), [&](int i) {
          return reference_.pierces(i, reference_.carried(ball, i), q, radius_);
        });
      };
      for (const Point& base : bases) {
        for (const Point& q : space.placesNear(base, passesNoFace, 1)) addOther(q, carried);
      }
    }
    places_ = carried.empty() ? around(p) : carried;
  }

  // False when no way leads to the proxy.
  bool moveTo(const ReportedProxy& proxy) {
    bool decided = false;
    std::vector<Point> arrived;
    for (const Point& ball : places_) {
      const auto end = endOf(ball, proxy, decided);
      if (end) addOther(*end, arrived);
      if (arrived.size() == kFollowers) break;
    }
    if (!arrived.empty()) places_ = arrived;
    return !arrived.empty() || !decided;
  }

  // First where the ball gets by rolling, if the proxy may be reported from there: other ends are places
  // around the proxy, which may all be on the wrong side of a face that it is on.
  std::optional<Point> endOf(const Point& ball, const ReportedProxy& proxy, bool& decided) {
    const Point& p = proxy.at;
    const FreeSpace space(reference_, p, kFarthestBall_m, radius_, seed_);
    const auto end = rolledTo(ball, proxy, [&](const Point& q) {
      return (q - p).norm() <= kFarthestBall_m && space.clear(q, q) && seesProxy(space, p, 0)(q);
    });
    if (end) {
      decided = true;
      return end;
    }
    const auto other = endOf(ball, p, false, decided);
    return other || trial_.sides == Sides::both ? other : endOf(ball, p, true, decided);
  }

  // Straight to the proxy; or as the proxy went, each part of its way nearer to the HIP, and then to it.
  std::optional<Point> rolledTo(const Point& ball, const ReportedProxy& proxy,
                                const std::function<bool(const Point&)>& arrives) {
    const double reach = 2 * (proxy.at - ball).norm() + 400e-6;  // half of which a ball may roll
    const auto rolled = [&](const Point& from, const Point& goal) {
      return Descent(reference_, from, reach, kRolling * radius_, ++seed_).from(from, goal, kSteps);
    };
    for (int k = 0; k < kRolls; ++k) {
      Point q = rolled(ball, proxy.at);
      if (!arrives(q) && proxy.hip) q = rolled(rolled(ball, *proxy.hip), proxy.at);
      if (arrives(q)) return q;
    }
    return std::nullopt;
  }

  std::optional<Point> endOf(const Point& ball, const Point& p, bool overlapping, bool& decided) {
    const double way = (p - ball).norm();
    const Point middle = 0.5 * (p + ball);
    std::vector<Point> ends;  // from none of which others are seen
    for (const double reach : {1.0 * way + 100e-6, 5 * way + 400e-6}) {
      FreeSpace space(reference_, middle, reach, radius_, ++seed_, overlapping);
      for (const double widening : kWidenings_m) {
        for (const Point& q : endsNear(space, ball, p, widening)) {
          if (space.connectsSimply(ball, q)) return q;
          const auto sees = [&](const Point& end) { return space.clear(end, q) && space.clear(q, end); };
          if (std::none_of(ends.begin(), ends.end(), sees)) ends.push_back(q);
        }
      }
    }
    decided = decided || !ends.empty();
    // Around a rim, the centre of a ball keeps its radius.
    for (const double wider : {0.0, 2 * trial_.toolRadius_m}) {
      FreeSpace space(reference_, middle, 5 * way + 400e-6 + wider, radius_, ++seed_, overlapping);
      for (const Point& q : ends) {
        if (space.connects(ball, q)) return q;
      }
      if (trial_.toolRadius_m == 0) break;
    }
    return std::nullopt;
  }

  // First those away from the faces at the proxy, on the sides where the ball is: in the corner of a crossing
  // that others may not be in.
  std::vector<Point> endsNear(FreeSpace& space, const Point& ball, const Point& p, double widening) const {
    const auto sees = seesProxy(space, p, widening);
    std::vector<Point> ends;
    Point away = Point::Zero();
    for (const int i : space.faces()) {
      const Face& f = reference_.face(i);
      if ((nearestOf(f, p) - p).norm() > 3 * radius_) continue;
      away += f.normal.dot(ball - f.a) < 0 ? Point(-f.normal) : f.normal;
    }
    for (double distance = 1.1 * radius_; distance < kFarthestEnd_m; distance *= 1.4) {
      const Point q = p + distance * away.stableNormalized();
      if (space.clear(q, q) && sees(q)) ends.push_back(q);
    }
    for (const Point& q : space.placesNear(p, sees, kEnds)) ends.push_back(q);
    return ends;
  }

  const Trial& trial_;
  Reference reference_;
  const std::vector<ReportedProxy>& proxies_;
  double radius_;
  std::uint64_t seed_;
  std::vector<Point> places_;
};

}  // namespace

bool follows(const Trial& trial, const std::vector<ReportedProxy>& proxies, double ballRadius) {
  return Follower(trial, proxies, ballRadius).arrives();
}

std::vector<Point> followers(const Trial& trial, const std::vector<ReportedProxy>& proxies,
                             double ballRadius) {
  Follower follower(trial, proxies, ballRadius);
  return follower.arrives() ? follower.places() : std::vector<Point>{};
}

}  // namespace hapticd::truth
