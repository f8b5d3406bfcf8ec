// Black boxes to files: when a fault latches, the ticks before it are written down.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/thread.h"
#include "realtime/servo/black_box.h"

namespace hapticd::server {

/// Where and how much of it is kept.
struct BlackBoxFiles {
  std::filesystem::path directory;
  int keep = 10;  ///< newest files of this device; older ones are deleted. 0: none is written
};

/// Writes ticks as CSV, oldest first, with the columns of `hapticd export` (record/sample.h). Throws std::runtime_error
/// that names the file.
void writeBlackBox(const std::filesystem::path& file, const std::string& device,
                   const std::vector<realtime::TickReport>& ticks);

/// Of one device. look() from the net thread; the file is written by a thread of its own.
class BlackBoxRecorder {
 public:
  /// `name` is the device's, and that of its folder in the directory.
  BlackBoxRecorder(std::string name, BlackBoxFiles files, realtime::BlackBox& box)
      : name_(std::move(name)), files_(std::move(files)), box_(box) {}
  ~BlackBoxRecorder() { finish(); }
  BlackBoxRecorder(const BlackBoxRecorder&) = delete;
  BlackBoxRecorder& operator=(const BlackBoxRecorder&) = delete;

  /// Logs a fault that latched since the last call, and has its ticks written.
  void look();
  /// Waits until what was begun is written.
  void finish();

 private:
  std::filesystem::path nextFile(const std::string& fault) const;

  std::string name_;
  BlackBoxFiles files_;
  realtime::BlackBox& box_;
  base::Thread writer_;
};

}  // namespace hapticd::server
