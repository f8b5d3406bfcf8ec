// Writes black boxes to files: the ticks before a fault that latched.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/thread.h"
#include "realtime/servo/black_box.h"

namespace hapticd::server {

/// Where black boxes are written, and how much is kept.
struct BlackBoxFiles {
  std::filesystem::path directory;
  int keep = 10;                     ///< newest files of this device to keep; 0: write none
  std::uint64_t bytes = 100U << 20;  ///< of all of them; the newest is kept whatever its size
};

/// Writes ticks as CSV, oldest first, with the columns of `hapticd export` (record/sample.h). Throws
/// std::runtime_error that names the file.
void writeBlackBox(const std::filesystem::path& file, const std::string& device,
                   const std::vector<realtime::TickReport>& ticks);

/// The black boxes of one device. Net thread; each file is written in a separate thread.
class BlackBoxRecorder {
 public:
  /// `name` is that of the device and of its folder in the directory.
  BlackBoxRecorder(std::string name, BlackBoxFiles files, realtime::BlackBox& box)
      : name_(std::move(name)), files_(std::move(files)), box_(box) {}
  ~BlackBoxRecorder() { finish(); }
  BlackBoxRecorder(const BlackBoxRecorder&) = delete;
  BlackBoxRecorder& operator=(const BlackBoxRecorder&) = delete;

  /// Logs a fault that latched since the last call and starts writing its ticks. Call several times per
  /// second. While a slow disk still takes the file before, the box stays frozen and waits.
  void poll();
  /// Waits until the files of all faults are written.
  void finish();

 private:
  std::filesystem::path nextFile(const std::string& fault) const;

  std::string name_;
  BlackBoxFiles files_;
  realtime::BlackBox& box_;
  std::atomic<bool> writes_{false};
  base::Thread writer_;  // last: it uses the others
};

}  // namespace hapticd::server
