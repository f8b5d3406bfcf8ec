#include "server/station/black_box_recorder.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <ctime>

#include "base/world.h"
#include "record/export.h"

namespace hapticd::server {
namespace {

namespace fs = std::filesystem;
using realtime::TickReport;

constexpr std::string_view kExtension = ".csv";

// What may stand in a file name.
std::string plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) == 0 && c != '_' && c != '-'; },
      '_');
  return text;
}

// Names begin with the time, so the oldest sort first.
void deleteOldest(const fs::path& directory, int keep) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(directory)) {
    if (entry.path().extension() == kExtension) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  const auto tooMany = static_cast<std::ptrdiff_t>(files.size()) - keep;
  for (std::ptrdiff_t i = 0; i < tooMany; ++i) fs::remove(files[static_cast<std::size_t>(i)]);
}

}  // namespace

void writeBlackBox(const fs::path& file, const std::string& device, const std::vector<TickReport>& ticks) {
  const base::Nanos wallOffset = base::wallNow() - base::now();
  record::CsvFile out(file);
  for (const TickReport& tick : ticks) out.add(record::sampleOf(device, tick, wallOffset));
  out.close();
}

fs::path BlackBoxRecorder::nextFile(const std::string& fault) const {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  std::tm utc{};
  gmtime_r(&now.tv_sec, &utc);
  char stamp[32] = {};
  std::strftime(stamp, sizeof stamp, "%Y%m%dT%H%M%S", &utc);
  char fraction[8] = {};
  std::snprintf(fraction, sizeof fraction, ".%03dZ", static_cast<int>(now.tv_nsec / 1000000 % 1000));
  return files_.directory / plain(name_) /
         (std::string(stamp) + fraction + "-" + plain(fault) + std::string(kExtension));
}

void BlackBoxRecorder::look() {
  if (!box_.frozen()) return;
  std::vector<TickReport> ticks = box_.take();
  if (ticks.empty()) return;
  const std::string fault = namesOf(Trips(ticks.back().guard.latched));
  if (files_.keep == 0) {
    spdlog::warn("device '{}': forces are off: {}", name_, fault);
    return;
  }
  const fs::path file = nextFile(fault);
  spdlog::warn("device '{}': forces are off: {}; the {} ticks before it go to {}", name_, fault, ticks.size(),
               file.string());
  finish();
  writer_ = std::thread([this, file, ticks = std::move(ticks)] {
    try {
      fs::create_directories(file.parent_path());
      writeBlackBox(file, name_, ticks);
      deleteOldest(file.parent_path(), files_.keep);
    } catch (const std::exception& error) {
      spdlog::error("device '{}': {}; set black_box_dir to a directory that can be written", name_,
                    error.what());
    }
  });
}

void BlackBoxRecorder::finish() {
  if (writer_.joinable()) writer_.join();
}

}  // namespace hapticd::server
