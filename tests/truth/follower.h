// A ball that follows a proxy from the last place where it was free: the second opinion about a move that
// seems to lead through a face.
//
// One tick alone does not tell on which side of a face a proxy is that lies on it within rounding, nor which
// of the places around a corner it came from. The follower knows: it is as far from each face as its radius,
// and remembers its place.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "truth/free_space.h"

namespace hapticd::truth {

/// What was reported in a tick.
struct ReportedProxy {
  Point at = Point::Zero();
  bool popped = false;                      ///< it stepped through a face
  std::optional<Point> hip = std::nullopt;  ///< it went towards this
};

/// Whether a ball of this radius can follow the proxies, one for each tick from the first of the trial, to
/// the last of them.
bool follows(const Trial& trial, const std::vector<ReportedProxy>& proxies, double ballRadius);

/// The places where that ball may be in the end; empty where there is no room for it.
std::vector<Point> followers(const Trial& trial, const std::vector<ReportedProxy>& proxies,
                             double ballRadius);

}  // namespace hapticd::truth
