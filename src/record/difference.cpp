#include "record/difference.h"

#include <cmath>
#include <sstream>

#include "base/time.h"
#include "record/recording_reader.h"

namespace hapticd::record {
namespace {

double depthOf(const realtime::TickReport& tick) {
  return tick.rendering.touching ? tick.rendering.depth_m : 0;
}

}  // namespace

void Difference::add(const realtime::TickReport& then, const realtime::TickReport& now) {
  if (points_.empty()) begin_ = then.time;
  DifferencePoint point;
  point.time_s = base::toSeconds(then.time - begin_);
  point.force_N = then.force_N.norm();
  point.forceNow_N = now.force_N.norm();
  point.depth_m = depthOf(then);
  point.depthNow_m = depthOf(now);
  points_.push_back(point);

  same_ += sameOutcome(then, now) ? 1 : 0;
  touching_ += then.rendering.touching || now.rendering.touching ? 1 : 0;
  const double force_N = (now.force_N - then.force_N).norm();
  sum_N_ += force_N;
  if (force_N > largest_N_) {
    largest_N_ = force_N;
    largestAt_s_ = point.time_s;
  }
  const double depth_m = std::abs(point.depthNow_m - point.depth_m);
  sumDepth_m_ += depth_m;
  largestDepth_m_ = std::max(largestDepth_m_, depth_m);
}

void Difference::add(const LostEvent& lost) {
  complete_ = false;
  if (lost.what == LostEvent::What::ticks) lost_ += lost.count;
}

double Difference::shareOf(double sum) const noexcept {
  const std::uint64_t count = touching_ > 0 ? touching_ : ticks();
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

double Difference::mean_N() const noexcept {
  return shareOf(sum_N_);
}

double Difference::meanDepth_m() const noexcept {
  return shareOf(sumDepth_m_);
}

std::string lawDifference(const RecordingHeader& header) {
  if (header.law.number == realtime::kForceLaw) return {};
  return "the recording has force law " + std::to_string(header.law.number) + ", this program law " +
         std::to_string(realtime::kForceLaw);
}

std::vector<Difference> compare(const std::filesystem::path& session, const RerenderChanges& changes,
                                std::string& remark, std::string& law) {
  RecordingReader reader(session);
  law = lawDifference(reader.header());
  Rerenderer again(reader.header(), changes);
  std::vector<Difference> devices;
  for (const RecordedDevice& device : reader.header().devices) devices.emplace_back(device.names.front());
  for (RecordingEvent event; reader.next(event);) {
    if (const realtime::TickReport* now = again.feed(event)) {
      const auto& [device, tick] = std::get<TickEvent>(event);
      if (again.comparable(device)) {
        devices[device].add(tick.report, *now);
      } else {
        devices[device].skip();
      }
    }
    if (const auto* lost = std::get_if<LostEvent>(&event)) {
      // Of scene events it is not known for which device.
      for (std::uint32_t i = 0; i < devices.size(); ++i) {
        if (lost->what == LostEvent::What::sceneEvents || lost->device == i) devices[i].add(*lost);
      }
    }
  }
  for (std::uint32_t i = 0; i < devices.size(); ++i) devices[i].setKnowsPast(again.knowsPast(i));
  remark = reader.remark();
  return devices;
}

std::string describe(const RerenderChanges& changes) {
  std::ostringstream text;
  const auto add = [&](const char* name, const std::optional<double>& value, double scale, const char* unit) {
    if (value) text << (text.tellp() > 0 ? ", " : "") << name << ' ' << *value * scale << unit;
  };
  add("stiffness", changes.stiffness_N_per_m, 1, " N/m");
  add("damping", changes.damping_Ns_per_m, 1, " Ns/m");
  add("static friction", changes.staticFriction, 1, "");
  add("dynamic friction", changes.dynamicFriction, 1, "");
  add("tool radius", changes.toolRadius_m, 1e3, " mm");
  if (changes.forceShading) text << (text.tellp() > 0 ? ", " : "") << "force shading";
  if (changes.raw) text << (text.tellp() > 0 ? ", " : "") << "raw: no guard, no limits";
  return text.tellp() > 0 ? text.str() : "nothing";
}

}  // namespace hapticd::record
