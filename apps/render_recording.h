// hapticd render --session: re-renders a recording, as it was or with changes.
#pragma once

#include <string>

#include "record/rerender.h"

namespace hapticd::apps {

struct RecordingRenderOptions {
  std::string session;
  std::string out;     ///< CSV with both forces of each tick; empty: no file
  std::string report;  ///< HTML; empty: no file
  record::RerenderChanges changes;
};

/// Prints the difference. Returns 1 when nothing was changed and the force law is the same but something
/// differs, else statusFor() the recording.
int renderSession(const RecordingRenderOptions& options);

}  // namespace hapticd::apps
