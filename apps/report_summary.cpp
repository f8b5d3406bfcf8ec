#include "report_summary.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "wire/messages.h"

namespace hapticd::apps {
namespace {

// Reports stamped with a servo tick and sent at once; the others may describe something older.
constexpr std::array kTimely{ReportKind::pose,    ReportKind::velocity, ReportKind::force,
                             ReportKind::depth,   ReportKind::angle,    ReportKind::contactPoint,
                             ReportKind::touching};
constexpr std::array kLimits_us{50.0,   100.0,   200.0,   500.0,   1000.0,  2000.0,
                                5000.0, 10000.0, 20000.0, 50000.0, 100000.0};
constexpr std::size_t kMostTexts = 100;

double norm(const Vec3& v) {
  return std::hypot(v[0], v[1], v[2]);
}

double seconds(Time::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

template <class... Arguments>
std::string line(const char* format, Arguments... arguments) {
  char text[160];
  std::snprintf(text, sizeof text, format, arguments...);
  return std::string(text) + '\n';
}

}  // namespace

ReportSummary::ReportSummary(Client& client) : client_(client) {
  client_.onTouching([this](const TouchingReport& r) { onTouching(r); });
  client_.onForce([this](const ForceReport& r) { onForce(r); });
  client_.onDepth([this](const DepthReport& r) { deepest_m_ = std::max(deepest_m_, r.depth_m); });
  client_.onText([this](const TextReport& r) { onText(r); });
  client_.onConnection([this](const ConnectionReport&) { touchingKnown_ = false; });
  restart();
}

void ReportSummary::restart() {
  start_ = client_.statistics();
  started_ = std::chrono::steady_clock::now();
  touchingKnown_ = false;
  contact_s_ = observed_s_ = peakForce_N_ = forceSum_N_ = deepest_m_ = 0;
  forceCount_ = 0;
}

void ReportSummary::onTouching(const TouchingReport& report) {
  if (touchingKnown_) {
    const double elapsed = std::max(0.0, apps::seconds(report.time - lastTouching_.time));
    observed_s_ += elapsed;
    if (lastTouching_.touching) contact_s_ += elapsed;
  }
  lastTouching_ = report;
  touchingKnown_ = true;
}

void ReportSummary::onForce(const ForceReport& report) {
  const double force_N = norm(report.force_N);
  peakForce_N_ = std::max(peakForce_N_, force_N);
  if (touchingKnown_ && lastTouching_.touching) {
    forceSum_N_ += force_N;
    ++forceCount_;
  }
}

void ReportSummary::onText(const TextReport& report) {
  const bool fault = report.text.starts_with(wire::kNoForceText);
  if (report.severity == Severity::error && !fault && firstError_.empty()) firstError_ = report.text;
  const std::string text = std::string(nameOf(report.severity)) + ": " + report.text;
  const auto known =
      std::find_if(texts_.begin(), texts_.end(), [&](const auto& t) { return t.first == text; });
  if (known != texts_.end()) {
    ++known->second;
  } else if (texts_.size() < kMostTexts) {
    texts_.emplace_back(text, 1);
  }
}

double ReportSummary::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
}

double ReportSummary::contactFraction() const {
  return observed_s_ > 0 ? contact_s_ / observed_s_ : 0;
}

double ReportSummary::meanForceTouching_N() const {
  return forceCount_ > 0 ? forceSum_N_ / static_cast<double>(forceCount_) : 0;
}

std::uint64_t ReportSummary::count(ReportKind kind) const {
  return client_.statistics()[kind].count - start_[kind].count;
}

std::uint64_t ReportSummary::reports() const {
  const Statistics now = client_.statistics();
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < kReportKinds; ++i) sum += now.reports[i].count - start_.reports[i].count;
  return sum;
}

LatencyHistogram ReportSummary::latency() const {
  const Statistics now = client_.statistics();
  LatencyHistogram sum;
  for (const ReportKind kind : kTimely) {
    LatencyHistogram since = now[kind].latency;
    since -= start_[kind].latency;
    sum += since;
  }
  return sum;
}

std::string ReportSummary::text() const {
  const double s = seconds();
  std::string text = line("summary of %.1f s", s);
  for (std::size_t i = 0; i < kReportKinds; ++i) {
    const auto kind = static_cast<ReportKind>(i);
    const std::uint64_t n = count(kind);
    if (n == 0) continue;
    text += line("  reports %-15s %8llu  %8.1f /s", std::string(nameOf(kind)).c_str(),
                 static_cast<unsigned long long>(n), static_cast<double>(n) / s);
  }
  text += line("  reports total           %8llu", static_cast<unsigned long long>(reports()));
  text += line("  contact time            %8.2f s  (%.1f %%)", contactSeconds(), 100 * contactFraction());
  text += line("  peak force              %8.3f N", peakForce_N());
  text += line("  mean force touching     %8.3f N", meanForceTouching_N());
  text += line("  deepest penetration     %8.3f mm", deepest_m() * 1000);
  const LatencyHistogram l = latency();
  text += line("  latency p50             %8.3f ms", l.quantile_us(0.5) / 1000);
  text += line("  latency p99             %8.3f ms", l.quantile_us(0.99) / 1000);
  std::uint64_t below = 0;
  for (const double limit : kLimits_us) {
    const std::uint64_t n = l.countBelow_us(limit);
    if (n > below)
      text +=
          line("  latency < %6.2f ms      %8llu", limit / 1000, static_cast<unsigned long long>(n - below));
    below = n;
  }
  if (l.count() > below)
    text += line("  latency more            %8llu", static_cast<unsigned long long>(l.count() - below));
  text += line("  server texts            %8zu", texts_.size());
  for (const auto& [what, n] : texts_)
    text += "    " + what + (n > 1 ? " (x" + std::to_string(n) + ")" : "") + '\n';
  return text;
}

std::string ReportSummary::json() const {
  const LatencyHistogram l = latency();
  nlohmann::json result;
  result["seconds"] = seconds();
  for (std::size_t i = 0; i < kReportKinds; ++i) {
    const auto kind = static_cast<ReportKind>(i);
    std::string name(nameOf(kind));
    std::replace(name.begin(), name.end(), ' ', '_');
    result["reports"][name] = count(kind);
  }
  result["reports_total"] = reports();
  result["contact_s"] = contactSeconds();
  result["contact_fraction"] = contactFraction();
  result["peak_force_N"] = peakForce_N();
  result["mean_force_touching_N"] = meanForceTouching_N();
  result["deepest_mm"] = deepest_m() * 1000;
  result["latency_ms"] = {{"p50", l.quantile_us(0.5) / 1000}, {"p99", l.quantile_us(0.99) / 1000}};
  result["texts"] = nlohmann::json::array();
  for (const auto& [what, n] : texts_) result["texts"].push_back({{"text", what}, {"count", n}});
  return result.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace hapticd::apps
