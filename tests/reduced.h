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

}  // namespace hapticd
