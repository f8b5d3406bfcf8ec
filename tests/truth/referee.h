// Drives the renderer through a trial and judges every tick.
//
// | rule | claim |
// |---|---|
// | finite | force and proxy are finite |
// | status | no jump and no release: trials contain neither |
// | fields | touching, depth, contact count and the sum of the contacts agree |
// | force | F <= largest K * distance of proxy and HIP, plus damping and friction |
// | share | static, one stiffness, a point, no slits: all of the springs act, but for 20 % |
// | through | the proxy did not get where a ball of 4.9 µm can not follow: no face, no gap below 10 µm |
// | escaped | the proxy is within the walls of the trial |
// | lost | without contact the proxy is at the HIP |
// | free | no force while the straight way from the proxy to the HIP is free |
// | climbed | frictionless, static: the proxy never moves away from the HIP |
// | stuck | frictionless, static: small moves reach no place that is nearer to the HIP by 10 µm |
// | direction | the normal force is a non-negative sum of the normals of the faces at the proxy |
// | law | one surface alone: F = (K depth - B v) normal, times the share that acts |
// | overlap | a ball overlaps no face |
// | energy | static: the hand gains no more over any contact than what shares that return store |
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "truth/trial.h"

namespace hapticd::truth {

struct Finding {
  std::string rule;
  int tick = 0;
  std::string text;
};

struct RefereeOptions {
  /// Of the ticks, for the rules that take long: stuck, direction, law, overlap.
  double share = 0.01;
  /// Those rules judge the last tick only: for the shrinker.
  bool longRulesAtTheEnd = false;
};

struct Verdict {
  std::optional<Finding> finding;  ///< the first one, which ends the trial
  std::uint64_t ticks = 0;
  std::uint64_t touching = 0;
  std::uint64_t limited = 0;    ///< of those: a share of the springs acts, so that they give no energy
  std::uint64_t suspected = 0;  ///< moves near an edge of a face, judged by a search for a path
  std::uint64_t undecided = 0;  ///< of those: in a wedge too narrow to tell
  std::uint64_t longRules = 0;  ///< ticks that all rules judged
};

Verdict judge(const Trial& trial, const RefereeOptions& options = {});

}  // namespace hapticd::truth
