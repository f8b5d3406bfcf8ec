// hapticd render --session: a recorded session once more, as it was or with something changed.
#pragma once

#include <string>

#include "record/rerender.h"

namespace hapticd::apps {

struct RecordingRenderOptions {
  std::string session;
  std::string out;     ///< CSV with both forces of each tick; empty: none
  std::string report;  ///< HTML; empty: none
  record::RerenderChanges changes;
};

/// Prints what differs. 1 when nothing was changed and yet something differs, else 0.
int renderSession(const RecordingRenderOptions& options);

}  // namespace hapticd::apps
