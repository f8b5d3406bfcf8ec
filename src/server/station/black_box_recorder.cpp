#include "server/station/black_box_recorder.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <ctime>
#include <span>
#include <system_error>

#include "base/wall_offset.h"
#include "base/world.h"
#include "record/crc32.h"
#include "record/export.h"

namespace hapticd::server {
namespace {

namespace fs = std::filesystem;
using realtime::TickReport;

constexpr std::string_view kExtension = ".csv";

bool isPlain(unsigned char c) {
  return std::isalnum(c) != 0 || c == '_' || c == '-';
}

// Replaces characters that are not safe in a file name.
std::string plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return !isPlain(c); }, '_');
  return text;
}

// Percent-encoded, so that each device has a folder of its own; a long one is cut, because file systems take
// 255 bytes, and ends with the checksum of the name.
std::string folderOf(const std::string& device) {
  constexpr std::size_t kLongest = 200;
  std::string folder;
  for (const unsigned char c : device) {
    if (isPlain(c)) {
      folder += static_cast<char>(c);
    } else {
      folder += fmt::format("%{:02X}", c);
    }
  }
  if (folder.size() <= kLongest) return folder;
  return folder.substr(0, kLongest) + fmt::format("%{:08X}", record::crc32(std::as_bytes(std::span(device))));
}

// Whether the name is one that nextFile() makes.
bool isBlackBox(const std::string& name) {
  constexpr std::string_view kForm = "00000000T000000.000Z-";
  if (name.size() <= kForm.size() + kExtension.size() || !name.ends_with(kExtension)) return false;
  return std::equal(kForm.begin(), kForm.end(), name.begin(), [](char form, char c) {
    return form == '0' ? std::isdigit(static_cast<unsigned char>(c)) != 0 : form == c;
  });
}

// Names begin with the time, so the oldest sort first. The newest stays, also where the clock was set back.
void deleteOldest(const fs::path& newest, int keep, std::uint64_t bytes) {
  base::Files& files = base::world().files;
  const fs::path directory = newest.parent_path();
  std::vector<std::string> names = files.list(directory);
  std::erase_if(names,
                [&](const std::string& name) { return !isBlackBox(name) || name == newest.filename(); });
  names.push_back(newest.filename());
  std::uint64_t kept = 0;
  for (std::size_t i = names.size(); i-- > 0;) {
    const fs::path file = directory / names[i];
    kept += files.open(file)->size();
    const std::size_t newer = names.size() - 1 - i;
    if (newer > 0 && (newer >= static_cast<std::size_t>(keep) || kept > bytes)) files.remove(file);
  }
}

// A file without ticks, of a full disk, would later take the place of an older one that has some.
void deleteEmpty(const fs::path& file) {
  base::Files& files = base::world().files;
  try {
    if (files.open(file)->size() == 0) files.remove(file);
  } catch (const std::exception&) {
    // It could not even be created.
  }
}

}  // namespace

void writeBlackBox(const fs::path& file, const std::string& device, const std::vector<TickReport>& ticks) {
  const base::Nanos wallOffset = base::wallOffset();
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
  return files_.directory / folderOf(name_) /
         (std::string(stamp) + fraction + "-" + plain(fault) + std::string(kExtension));
}

void BlackBoxRecorder::poll() {
  if (!box_.frozen() || writes_.load(std::memory_order_acquire)) return;
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
  writes_.store(true, std::memory_order_release);
  auto write = [this, file, ticks = std::move(ticks)]() mutable -> std::optional<base::Nanos> {
    const std::vector<TickReport> box = std::exchange(ticks, {});
    if (box.empty()) return std::nullopt;  // written already
    try {
      base::world().files.createFolder(file.parent_path());
      writeBlackBox(file, name_, box);
      deleteOldest(file, files_.keep, files_.bytes);
    } catch (const std::exception& error) {
      spdlog::error("device '{}': {}; set black_box_dir to a directory that can be written", name_,
                    error.what());
      deleteEmpty(file);
    }
    writes_.store(false, std::memory_order_release);
    return std::nullopt;
  };
  try {
    writer_ = base::Thread({.name = "black box"}, std::move(write));
  } catch (const std::system_error& error) {
    writes_.store(false, std::memory_order_release);  // the next one may be written
    spdlog::error("device '{}': {} is not written: {}", name_, file.string(), error.what());
  }
}

void BlackBoxRecorder::finish() {
  writer_.stop();
  poll();
  writer_.stop();
}

}  // namespace hapticd::server
