#include "truth/follower.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace hapticd::truth {
namespace {

constexpr double kFree = 4;            // radii around a proxy without faces: its place is that of the ball
constexpr std::size_t kEnds = 6;       // tried around the proxy, for each widening
constexpr std::size_t kFollowers = 4;  // where the place is not known
constexpr std::array<double, 3> kWidenings_m{30e-6, 5e-6, 0};  // of the faces between ball and proxy

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
      arrived = moveTo(p);
    }
    return arrived;
  }

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

  // A place that sees the proxy. On the plane of a face, within rounding, it may be on either side.
  auto seesProxy(const FreeSpace& space, const Point& p, double widening) const {
    return [&space, &p, widening, this](const Point& q) {
      return std::none_of(space.faces().begin(), space.faces().end(), [&](int i) {
        return reference_.pierces(i, q, p, widening) && !reference_.onPlane(reference_.face(i), p);
      });
    };
  }

  // The followers where the proxy may be anywhere around its reported place.
  std::vector<Point> around(const Point& p) {
    FreeSpace space(reference_, p, 400e-6, radius_, seed_);
    return space.placesNear(p, seesProxy(space, p, 0), kFollowers);
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

  // False when no way leads to the proxy; the follower then waits for the next tick.
  bool moveTo(const Point& p) {
    bool decided = false;
    std::vector<Point> arrived;
    for (const Point& ball : places_) {
      const auto end = endOf(ball, p, decided);
      if (end) addOther(*end, arrived);
      if (arrived.size() == kFollowers) break;
    }
    if (!arrived.empty()) places_ = arrived;
    return !arrived.empty() || !decided;
  }

  std::optional<Point> endOf(const Point& ball, const Point& p, bool& decided) {
    const double way = (p - ball).norm();
    std::vector<Point> ends;
    for (const double reach : {1.0 * way + 100e-6, 5 * way + 400e-6}) {
      FreeSpace space(reference_, 0.5 * (p + ball), reach, radius_, ++seed_);
      for (const double widening : kWidenings_m) {
        for (const Point& q : space.placesNear(p, seesProxy(space, p, widening), kEnds)) {
          if (space.connectsSimply(ball, q)) return q;
          addOther(q, ends);
        }
      }
    }
    decided = decided || !ends.empty();
    FreeSpace space(reference_, 0.5 * (p + ball), 5 * way + 400e-6, radius_, ++seed_);
    for (const Point& q : ends) {
      if (space.connects(ball, q)) return q;
    }
    return std::nullopt;
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

}  // namespace hapticd::truth
