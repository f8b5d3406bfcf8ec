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

// Replaces characters that are not safe in a file name.
std::string plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) == 0 && c != '_' && c != '-'; },
      '_');
  return text;
}

// Names begin with the time, so the oldest sort first.
void deleteOldest(const fs::path& directory, int keep) {
  base::Files& files = base::world().files;
  std::vector<std::string> names = files.list(directory);
  std::erase_if(names, [](const std::string& name) { return fs::path(name).extension() != kExtension; });
  const auto tooMany = static_cast<std::ptrdiff_t>(names.size()) - keep;
  for (std::ptrdiff_t i = 0; i < tooMany; ++i) files.remove(directory / names[static_cast<std::size_t>(i)]);
}

}  // namespace

void writeBlackBox(const fs::path& file, const std::string& device, const std::vector<TickReport>& ticks) {
  const base::Nanos wallOffset = base::wallNow() - base::now();
  record::CsvFile out(file);
  for (const TickReport& tick : ticks) out.add(record::sampleOf(device, tick, wallOffset));
  out.close();
}

fs::path BlackBoxRecorder::nextFile(const std::string& fault) const {
  const base::Nanos now = base::wallNow();
  const auto seconds = static_cast<std::time_t>(now / 1'000'000'000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char stamp[32] = {};
  std::strftime(stamp, sizeof stamp, "%Y%m%dT%H%M%S", &utc);
  char fraction[8] = {};
  std::snprintf(fraction, sizeof fraction, ".%03dZ", static_cast<int>(now / 1'000'000 % 1000));
  return files_.directory / plain(name_) /
         (std::string(stamp) + fraction + "-" + plain(fault) + std::string(kExtension));
}

void BlackBoxRecorder::poll() {
  if (!box_.frozen()) return;
  std::vector<TickReport> ticks = box_.take();
  if (ticks.empty()) return;
  const std::string fault = namesOf(Trips(ticks.back().guard.latched));
  if (files_.keep == 0) {
    spdlog::warn("device '{}': forces are off: {}", name_, fault);
    return;
  }
  const fs::path file = nextFile(fault);
  spdlog::warn("device '{}': forces are off: {}; writing the last {} ticks to {}", name_, fault, ticks.size(),
               file.string());
  finish();
  writer_ = base::Thread(
      {.name = "black box"}, [this, file, ticks = std::move(ticks)]() mutable -> std::optional<base::Nanos> {
        const std::vector<TickReport> box = std::exchange(ticks, {});
        if (box.empty()) return std::nullopt;  // written already
        try {
          base::world().files.createFolder(file.parent_path());
          writeBlackBox(file, name_, box);
          deleteOldest(file.parent_path(), files_.keep);
        } catch (const std::exception& error) {
          spdlog::error("device '{}': {}; set black_box_dir to a directory that can be written", name_,
                        error.what());
        }
        return std::nullopt;
      });
}

void BlackBoxRecorder::finish() {
  writer_.stop();
}

}  // namespace hapticd::server
