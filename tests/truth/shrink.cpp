#include "truth/shrink.h"

#include <algorithm>
#include <utility>

namespace hapticd::truth {
namespace {

class Shrinker {
 public:
  Shrinker(Trial trial, std::string rule, int runs)
      : best_(std::move(trial)), rule_(std::move(rule)), runs_(runs) {}

  Trial run() {
    std::size_t before = 0;
    do {
      before = size();
      dropFirstTicks();
      // What is no longer enclosed may escape.
      if (rule_ != "escaped") dropParts();
      dropFrom([](Trial & t) -> auto& { return t.hips; });
      simplify();
    } while (size() < before && runs_ > 0);
    dropVertices();
    return best_;
  }

 private:
  std::size_t size() const {
    return best_.triangleCount() + best_.hips.size() + best_.objects.size() + best_.planes.size();
  }

  // Takes the trial over when it still breaks the rule; its ticks then end there.
  bool take(Trial trial) {
    if (runs_-- <= 0 || trial.hips.size() < 2) return false;
    RefereeOptions options;
    options.longRulesAtTheEnd = true;
    const Verdict verdict = judge(trial, options);
    if (!verdict.finding || verdict.finding->rule != rule_) return false;
    trial.hips.resize(static_cast<std::size_t>(verdict.finding->tick) + 1);
    best_ = std::move(trial);
    return true;
  }

  void dropFirstTicks() {
    for (std::size_t n = best_.hips.size() / 2; n > 0; n /= 2) {
      while (n < best_.hips.size()) {
        Trial trial = best_;
        // The poses of moving objects belong to ticks.
        if (!trial.isStatic()) return;
        trial.hips.erase(trial.hips.begin(), trial.hips.begin() + static_cast<std::ptrdiff_t>(n));
        if (!take(std::move(trial))) break;
      }
    }
  }

  void dropParts() {
    dropFrom([](Trial & t) -> auto& { return t.objects; });
    dropFrom([](Trial & t) -> auto& { return t.planes; });
    for (std::size_t i = 0; i < best_.objects.size(); ++i) {
      dropFrom([i](Trial & t) -> auto& { return t.objects[i].triangles; });
    }
  }

  // Chunks of falling size (delta debugging).
  template <class List>
  void dropFrom(List&& list) {
    for (std::size_t n = std::max<std::size_t>(list(best_).size() / 2, 1);; n /= 2) {
      for (std::size_t i = 0; i < list(best_).size() && runs_ > 0;) {
        Trial trial = best_;
        auto& items = list(trial);
        const auto begin = items.begin() + static_cast<std::ptrdiff_t>(i);
        items.erase(begin, begin + static_cast<std::ptrdiff_t>(std::min(n, items.size() - i)));
        if (!take(std::move(trial))) i += n;
      }
      if (n <= 1) return;
    }
  }

  template <class Change>
  void tryTo(Change&& change) {
    Trial trial = best_;
    change(trial);
    take(std::move(trial));
  }

  void simplify() {
    const auto materials = [](Trial& t, auto&& change) {
      for (TrialObject& object : t.objects) change(object.material);
      for (TrialPlane& plane : t.planes) change(plane.material);
    };
    tryTo([&](Trial& t) { materials(t, [](Material& m) { m = Material{}; }); });
    tryTo([&](Trial& t) { materials(t, [](Material& m) { m.staticFriction = m.dynamicFriction = 0; }); });
    tryTo([&](Trial& t) { materials(t, [](Material& m) { m.damping_Ns_per_m = 0; }); });
    tryTo([&](Trial& t) { materials(t, [](Material& m) { m.stiffness_N_per_m = 1000; }); });
    tryTo([&](Trial& t) { materials(t, [](Material& m) { m.popthrough_N = 0; }); });
    tryTo([](Trial& t) { t.worldUnitsPerMetre = 1000; });
    tryTo([](Trial& t) {
      for (TrialObject& object : t.objects) object.poses.resize(1);
    });
    tryTo([](Trial& t) {
      for (TrialObject& object : t.objects) object.target.clear();
    });
    tryTo([](Trial& t) { t.toolRadius_m = 0; });
    tryTo([](Trial& t) { t.sides = Sides::both; });
  }

  void dropVertices() {
    for (TrialObject& object : best_.objects) {
      std::vector<Corner> vertices;
      std::vector<Corner> target;
      std::vector<std::uint32_t> place(object.vertices.size(), ~0U);
      for (auto& t : object.triangles) {
        for (std::uint32_t& v : t) {
          if (place[v] == ~0U) {
            place[v] = static_cast<std::uint32_t>(vertices.size());
            vertices.push_back(object.vertices[v]);
            if (!object.target.empty()) target.push_back(object.target[v]);
          }
          v = place[v];
        }
      }
      object.vertices = vertices;
      object.target = target;
    }
  }

  Trial best_;
  std::string rule_;
  int runs_;
};

}  // namespace

Trial shrink(Trial trial, const Finding& finding, int runs) {
  trial.hips.resize(static_cast<std::size_t>(finding.tick) + 1);
  return Shrinker(std::move(trial), finding.rule, runs).run();
}

}  // namespace hapticd::truth
