#include "report_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace hapticd::apps {
namespace {

constexpr std::size_t kBars = 48;

void keep(std::deque<double>& values, double value) {
  values.push_back(value);
  if (values.size() > kBars) values.pop_front();
}

}  // namespace

std::string sparkline(const std::deque<double>& values, double most) {
  constexpr std::array kEighths{" ",      "\u2581", "\u2582", "\u2583", "\u2584",
                                "\u2585", "\u2586", "\u2587", "\u2588"};
  std::string bars(kBars - values.size(), ' ');
  for (const double value : values) {
    const double share = most > 0 ? std::clamp(value / most, 0.0, 1.0) : 0;
    bars += kEighths[static_cast<std::size_t>(std::lround(share * (kEighths.size() - 1)))];
  }
  return bars;
}

// The sensors of this server have a meaning; those of others a number.
std::string ReportView::sensorName(int sensor) const {
  static constexpr std::array kNames{"0 proxy", "1 hip", "2 contact"};
  if (client_.capabilities() && sensor >= 0 && sensor < static_cast<int>(kNames.size()))
    return kNames[static_cast<std::size_t>(sensor)];
  return "sensor " + std::to_string(sensor);
}

void ReportView::remember() {
  const LatestReports& latest = client_.latest();
  const Vec3& f = latest.force.force_N;
  keep(forces_N_, std::hypot(f[0], f[1], f[2]));
  keep(depths_m_, latest.depth.depth_m);
}

std::vector<std::string> ReportView::table(const ReportSummary& summary) {
  remember();
  const LatestReports& latest = client_.latest();
  const Statistics now = client_.statistics();
  std::vector<std::string> lines;
  char text[512];
  const auto add = [&](const char* format, auto... arguments) {
    std::snprintf(text, sizeof text, format, arguments...);
    lines.emplace_back(text);
  };
  const LatencyHistogram latency = summary.latency();
  add("%s@%s  %.0f s  latency p50 %.2f ms p99 %.2f ms", client_.device().c_str(), client_.server().c_str(),
      summary.seconds(), latency.quantile_us(0.5) / 1000, latency.quantile_us(0.99) / 1000);
  for (const auto& [sensor, pose] : latest.pose) {
    const Vec3& p = pose.position_m;
    const Quaternion& q = pose.orientation;
    add("  %-10s %8.2f %8.2f %8.2f mm  %6.3f %6.3f %6.3f %6.3f", sensorName(sensor).c_str(), p[0] * 1000,
        p[1] * 1000, p[2] * 1000, q[0], q[1], q[2], q[3]);
  }
  const Vec3& f = latest.force.force_N;
  add("  force      %8.3f %8.3f %8.3f N  |F| %.3f N  peak %.3f N", f[0], f[1], f[2],
      std::hypot(f[0], f[1], f[2]), summary.peakForce_N());
  add("  |F|        %s %.2f N", sparkline(forces_N_, summary.peakForce_N()).c_str(), summary.peakForce_N());
  add("  depth      %s %.2f mm", sparkline(depths_m_, summary.deepest_m()).c_str(),
      summary.deepest_m() * 1000);
  // Channel 6 is the gripper on this server only; other servers may use it for anything.
  const std::vector<double>& channels = latest.analog.channels;
  if (client_.capabilities() && channels.size() == 7) add("  gripper    %8.3f rad", channels[6]);
  add("  touching   %s  object %d  depth %.3f mm  angle %.1f deg  %.0f %% of time",
      latest.touching.touching ? "yes" : "no ", latest.touchedObject.object, latest.depth.depth_m * 1000,
      latest.angle.angle_deg, 100 * summary.contactFraction());
  // Above the rates: a low terminal shows the first lines only.
  if (!summary.texts().empty()) lines.push_back("  server: " + summary.texts().back().first);
  for (std::size_t i = 0; i < kReportKinds; ++i) {
    const auto kind = static_cast<ReportKind>(i);
    if (now[kind].count == 0) continue;
    add("  %-15s %8.0f /s  %llu", std::string(nameOf(kind)).c_str(), now.ratePerSecond(kind, before_),
        static_cast<unsigned long long>(summary.count(kind)));
  }
  before_ = now;
  return lines;
}

void ReportView::printLine(const ReportSummary& summary) {
  const LatestReports& latest = client_.latest();
  const Statistics now = client_.statistics();
  double rate = 0;
  for (std::size_t i = 0; i < kReportKinds; ++i)
    rate += now.ratePerSecond(static_cast<ReportKind>(i), before_);
  const LatencyHistogram latency = summary.latency();
  const Vec3& f = latest.force.force_N;
  std::printf(
      "%.0f s  %.0f reports/s  touching %s  object %d  force %.3f N  depth %.3f mm  angle %.1f deg  "
      "latency p50 %.2f ms p99 %.2f ms\n",
      summary.seconds(), rate, latest.touching.touching ? "yes" : "no", latest.touchedObject.object,
      std::hypot(f[0], f[1], f[2]), latest.depth.depth_m * 1000, latest.angle.angle_deg,
      latency.quantile_us(0.5) / 1000, latency.quantile_us(0.99) / 1000);
  std::fflush(stdout);
  before_ = now;
}

}  // namespace hapticd::apps
