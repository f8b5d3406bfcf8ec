// What the columns of an exported recording do not say: the file beside it.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace hapticd::record {

struct Sidecar {
  std::string json;
  std::string remark;  ///< of the reader; also in the object
};

/// A JSON object: program, force law, start, configuration, devices, surfaces that were in the scene with the
/// time of their first tick, markers. Reads the whole recording. Throws RecordingError, and what `beforeEach`
/// throws, which is called before each event.
Sidecar sidecarOf(
    const std::filesystem::path& recording, const std::function<void()>& beforeEach = [] {});

}  // namespace hapticd::record
