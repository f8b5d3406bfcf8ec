// A trial as a recording, for `hapticd render --session`.
#pragma once

#include <filesystem>

#include "truth/trial.h"

namespace hapticd::truth {

/// Records the trial as a server would have, without guard and limits. False, and no file, for trials that
/// move, deform or have planes, which the commands of a client cannot repeat tick by tick. Throws
/// record::RecordingError.
bool writeSession(const Trial& trial, const std::filesystem::path& file);

}  // namespace hapticd::truth
