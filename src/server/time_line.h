// Reads what a recording holds along its time.
#pragma once

#include <atomic>
#include <filesystem>

#include "server/web/replay_status.h"

namespace hapticd::server {

/// Reads the whole recording, until `stopping`. Lists have at most 300 entries. Throws
/// record::RecordingError.
TimeLine readTimeLine(const std::filesystem::path& file, const std::atomic<bool>& stopping);

}  // namespace hapticd::server
