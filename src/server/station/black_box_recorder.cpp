#include "server/station/black_box_recorder.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <system_error>

namespace hapticd::server {
namespace {

namespace fs = std::filesystem;
using realtime::TickReport;

constexpr std::string_view kExtension = ".csv";

std::string tripNames(std::uint32_t bits) {
  std::string names;
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    if ((bits & realtime::bit(trip.trip)) == 0) continue;
    if (!names.empty()) names += '+';
    names += trip.name;
  }
  return names;
}

// What may stand in a file name.
std::string plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) == 0 && c != '_' && c != '-'; },
      '_');
  return text;
}

void put(std::ostream& out, const geometry::Vec3& v) {
  out << ',' << v.x() << ',' << v.y() << ',' << v.z();
}

void writeTick(std::ostream& out, const TickReport& tick) {
  const auto& q = tick.device.orientation;
  out << tick.tick << ',' << tick.time << ',' << tick.timing.wakeupError << ',' << tick.timing.compute << ','
      << tick.revision;
  put(out, tick.device.position_m);
  put(out, tick.device.velocity_m_per_s);
  out << ',' << q.x() << ',' << q.y() << ',' << q.z() << ',' << q.w() << ',' << tick.device.buttons;
  put(out, tick.rendering.proxy_m);
  put(out, tick.rendering.force_N);
  put(out, tick.force_N);
  out << ',' << tick.rendering.touchedObject << ',' << tick.rendering.depth_m << ',' << tick.rendering.status
      << ',' << tripNames(tick.guard.active) << ',' << tripNames(tick.guard.latched) << '\n';
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

void writeBlackBox(const fs::path& file, const std::vector<TickReport>& ticks) {
  errno = 0;
  std::ofstream out(file);
  out.precision(17);
  out << "tick,time_ns,wakeup_error_ns,compute_ns,revision,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,qx,qy,"
         "qz,qw,buttons,proxy_x_m,proxy_y_m,proxy_z_m,rendered_x_N,rendered_y_N,rendered_z_N,written_x_N,"
         "written_y_N,written_z_N,object,depth_m,status,active,latched\n";
  for (const TickReport& tick : ticks) writeTick(out, tick);
  out.close();
  if (!out) throw fs::filesystem_error("black box not written", file, {errno, std::generic_category()});
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
  const std::string fault = tripNames(ticks.back().guard.latched);
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
      writeBlackBox(file, ticks);
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
