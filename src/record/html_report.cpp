#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "record/difference.h"

namespace hapticd::record {
namespace {

constexpr double kWidth = 1000;
constexpr double kHeight = 260;
constexpr double kLeft = 56;
constexpr double kBottom = 30;
constexpr double kTop = 12;
constexpr std::size_t kColumns = 900;

constexpr const char* kStyle = R"(<style>
:root { color-scheme: light dark; --then: light-dark(#0b62b5, #6cb6ff); --now: light-dark(#c4390b, #ff9a6c); }
body { font: 15px/1.45 system-ui, sans-serif; max-width: 1040px; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; } td, th { padding: .2em 1em .2em 0; text-align: left; }
svg { width: 100%; height: auto; } svg text { font-size: 12px; fill: currentColor; }
.grid { stroke: currentColor; stroke-opacity: .2; } .then { stroke: var(--then); } .now { stroke: var(--now); }
polyline { fill: none; stroke-width: 1.3; } .now { stroke-opacity: .85; }
b.then { color: var(--then); } b.now { color: var(--now); }
</style>)";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else
      out += c;
  }
  return out;
}

std::string number(double value, const char* format = "%.4g") {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// 1, 2 or 5 times a power of ten, so that about five fit.
double niceStep(double range) {
  const double rough = range / 5;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (rough <= step * power) return step * power;
  }
  return 10 * power;
}

// One plot of two curves over the same time.
class Plot {
 public:
  using Points = std::vector<DifferencePoint>;

  Plot(const Points& points, double DifferencePoint::*then, double DifferencePoint::*now, double scale)
      : points_(points), then_(then), now_(now), scale_(scale) {
    for (const DifferencePoint& p : points) {
      highest_ = std::max({highest_, finite(p.*then * scale), finite(p.*now * scale)});
      end_s_ = std::max(end_s_, p.time_s);
    }
    if (highest_ <= 0) highest_ = 1;
    if (end_s_ <= 0) end_s_ = 1;
  }

  std::string svg(const std::string& title) const {
    std::ostringstream out;
    out << "<svg viewBox=\"0 0 " << kWidth << ' ' << kHeight << "\" role=\"img\" aria-label=\"" << title
        << "\">\n";
    axes(out, title);
    curve(out, "then", then_);
    curve(out, "now", now_);
    out << "</svg>\n";
    return out.str();
  }

 private:
  static double finite(double value) { return std::isfinite(value) ? value : 0; }
  double x(double time_s) const { return kLeft + (kWidth - kLeft - 10) * time_s / end_s_; }
  double y(double value) const { return kHeight - kBottom - (kHeight - kBottom - kTop) * value / highest_; }

  void axes(std::ostream& out, const std::string& title) const {
    for (double v = 0; v <= highest_ * 1.0001; v += niceStep(highest_)) {
      out << "<line class=\"grid\" x1=\"" << kLeft << "\" x2=\"" << kWidth - 10 << "\" y1=\"" << number(y(v))
          << "\" y2=\"" << number(y(v)) << "\"/><text x=\"" << kLeft - 6 << "\" y=\"" << number(y(v) + 4)
          << "\" text-anchor=\"end\">" << number(v) << "</text>\n";
    }
    for (double t = 0; t <= end_s_ * 1.0001; t += niceStep(end_s_)) {
      out << "<text x=\"" << number(x(t)) << "\" y=\"" << kHeight - 10 << "\" text-anchor=\"middle\">"
          << number(t) << " s</text>\n";
    }
    out << "<text x=\"" << kLeft + 6 << "\" y=\"" << kTop + 10 << "\">" << title << "</text>\n";
  }

  // Each column keeps its lowest and highest value, so that no peak is lost.
  void curve(std::ostream& out, const char* name, double DifferencePoint::*value) const {
    out << "<polyline class=\"" << name << "\" points=\"";
    const std::size_t each = std::max<std::size_t>(1, points_.size() / kColumns);
    for (std::size_t i = 0; i < points_.size(); i += each) {
      const auto begin = points_.begin() + static_cast<std::ptrdiff_t>(i);
      const auto end = points_.begin() + static_cast<std::ptrdiff_t>(std::min(i + each, points_.size()));
      auto [low, high] = std::minmax_element(
          begin, end, [value](const auto& a, const auto& b) { return finite(a.*value) < finite(b.*value); });
      if (high < low) std::swap(low, high);
      for (const auto& point : {low, high}) {
        out << number(x(point->time_s), "%.2f") << ',' << number(y(finite((*point).*value * scale_)), "%.2f")
            << ' ';
        if (low == high) break;
      }
    }
    out << "\"/>\n";
  }

  const Points& points_;
  double DifferencePoint::*then_;
  double DifferencePoint::*now_;
  double scale_;
  double highest_ = 0;
  double end_s_ = 0;
};

void figures(std::ostream& out, const Difference& d) {
  const auto row = [&](const char* name, const std::string& value) {
    out << "<tr><th>" << name << "</th><td>" << value << "</td></tr>\n";
  };
  out << "<table>\n";
  row("ticks", std::to_string(d.ticks()) + ", touching then or now " + std::to_string(d.touching()));
  row("same in every bit",
      std::to_string(d.same()) + (d.same() == d.ticks() && d.ticks() > 0 ? ": all" : ""));
  row("largest difference of force", number(d.largest_N()) + " N, at " + number(d.largestAt_s()) + " s");
  row("mean difference of force", number(d.mean_N()) + " N while touching");
  row("largest difference of depth", number(d.largestDepth_m() * 1e3) + " mm");
  row("mean difference of depth", number(d.meanDepth_m() * 1e3) + " mm while touching");
  if (d.skipped() > 0) row("ticks that could not be compared", std::to_string(d.skipped()));
  if (d.lost() > 0) row("ticks that were not recorded", std::to_string(d.lost()));
  out << "</table>\n";
}

}  // namespace

std::string htmlReport(const std::string& session, const RerenderChanges& changes,
                       const std::vector<Difference>& devices, const std::string& remark) {
  std::ostringstream out;
  const std::string title = "Re-rendered recording " + escaped(session);
  out << "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>" << title << "</title>\n"
      << kStyle << "\n<h1>" << title << "</h1>\n<p>Changed: " << escaped(describe(changes))
      << ". <b class=\"then\">Blue</b> is recorded, <b class=\"now\">red</b> re-rendered."
         "</p>\n";
  if (!remark.empty()) out << "<p>" << escaped(remark) << "</p>\n";
  for (const Difference& device : devices) {
    out << "<h2>" << escaped(device.device()) << "</h2>\n";
    figures(out, device);
    if (device.ticks() == 0) continue;
    const auto& points = device.points();
    out << Plot(points, &DifferencePoint::force_N, &DifferencePoint::forceNow_N, 1)
               .svg("force on the hand, N")
        << Plot(points, &DifferencePoint::depth_m, &DifferencePoint::depthNow_m, 1e3)
               .svg("depth of penetration, mm");
  }
  out << "</html>\n";
  return out.str();
}

}  // namespace hapticd::record
