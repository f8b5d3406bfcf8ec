// The size of a test: the whole in release, a tenth where a sanitizer makes every step ten times slower.
#pragma once

#include <algorithm>

namespace hapticd {

/// A tenth of `full` (at least `least`) in builds with a sanitizer, else `full`.
constexpr int reduced(int full, int least = 1) {
#ifdef HAPTICD_SANITIZED
  return std::max(full / 10, least);
#else
  return std::max(full, least);
#endif
}

/// Whether combination number `i` of those that a test goes through is tried: all in release, every seventh
/// where a sanitizer makes every step ten times slower (seven divides none of the usual numbers of values).
constexpr bool tried(int i) {
#ifdef HAPTICD_SANITIZED
  return i % 7 == 0;
#else
  return i >= 0;
#endif
}

}  // namespace hapticd
