// A temporary recording.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

namespace hapticd::test {

/// A path without a file; the destructor removes the file.
class RecordingFile {
 public:
  RecordingFile() {
    static int count = 0;
    path_ = std::filesystem::temp_directory_path() /
            ("hapticd_session_" + std::to_string(::getpid()) + '_' + std::to_string(++count) + ".haptics");
    std::filesystem::remove(path_);
  }
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;
  ~RecordingFile() { std::filesystem::remove(path_); }

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace hapticd::test
