// The fewest triangles and ticks that still break a rule.
#pragma once

#include "truth/referee.h"

namespace hapticd::truth {

/// Removes ticks, objects, triangles and properties for as long as the same rule is broken, in at most `runs`
/// trials.
Trial shrink(Trial trial, const Finding& finding, int runs = 1500);

}  // namespace hapticd::truth
