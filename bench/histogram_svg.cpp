#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "bench/report.h"

namespace hapticd::bench {
namespace {

constexpr double kWidth = 720;
constexpr double kHeight = 300;
constexpr double kLeft = 60;
constexpr double kRight = 15;
constexpr double kTop = 40;
constexpr double kBottom = 45;
constexpr int kBins = 120;
constexpr std::array kColours{"#1f6fb4", "#d1661f", "#4f9d4f", "#8c5fb0"};

std::string format(const char* pattern, auto... values) {
  std::array<char, 512> text{};
  std::snprintf(text.data(), text.size(), pattern, values...);
  return text.data();
}

// One decade of shares takes the same height; the floor is one sample.
class Axes {
 public:
  explicit Axes(const Figure& figure) : from_(figure.from), to_(figure.to) {
    std::size_t most = 10;
    for (const auto& series : figure.series) most = std::max(most, series.samples.count());
    floor_ = -std::ceil(std::log10(static_cast<double>(most)));
  }
  double x(double value) const { return kLeft + (value - from_) / (to_ - from_) * (kWidth - kLeft - kRight); }
  double y(double share) const {
    const double decade = share > 0 ? std::max(std::log10(share), floor_) : floor_;
    return kTop + decade / floor_ * (kHeight - kTop - kBottom);
  }
  double floorDecade() const { return floor_; }
  double binWidth() const { return (to_ - from_) / kBins; }
  int binOf(double value) const {
    return std::clamp(static_cast<int>((value - from_) / binWidth()), 0, kBins - 1);
  }

 private:
  double from_;
  double to_;
  double floor_ = -5;
};

std::string grid(const Figure& figure, const Axes& axes) {
  std::string svg;
  for (int decade = 0; decade >= static_cast<int>(axes.floorDecade()); --decade) {
    const double y = axes.y(std::pow(10.0, decade));
    svg +=
        format("<line x1='%.0f' y1='%.1f' x2='%.0f' y2='%.1f' stroke='#ddd'/>", kLeft, y, kWidth - kRight, y);
    svg += format("<text x='%.0f' y='%.1f' text-anchor='end'>%g %%</text>\n", kLeft - 6, y + 4,
                  100 * std::pow(10.0, decade));
  }
  for (int i = 0; i <= 6; ++i) {
    const double value = figure.from + (figure.to - figure.from) * i / 6;
    svg += format("<text x='%.1f' y='%.0f' text-anchor='middle'>%g</text>\n", axes.x(value),
                  kHeight - kBottom + 18, value);
  }
  return svg +
         format("<text x='%.0f' y='%.0f' text-anchor='middle'>%s; the last column holds all above</text>\n",
                (kLeft + kWidth - kRight) / 2, kHeight - 8, figure.unit.c_str());
}

std::string curve(const Figure::Series& series, const Axes& axes, const Figure& figure, const char* colour) {
  std::array<double, kBins> share{};
  for (const double value : series.samples.values()) {
    share[static_cast<std::size_t>(axes.binOf(value))] += 1.0 / static_cast<double>(series.samples.count());
  }
  std::string points = format("%.1f,%.1f", axes.x(figure.from), axes.y(0));
  for (int i = 0; i < kBins; ++i) {
    const double y = axes.y(share[static_cast<std::size_t>(i)]);
    const double left = figure.from + i * axes.binWidth();
    points += format(" %.1f,%.1f %.1f,%.1f", axes.x(left), y, axes.x(left + axes.binWidth()), y);
  }
  points += format(" %.1f,%.1f", axes.x(figure.to), axes.y(0));
  return "<polyline points='" + points + "' fill='" + colour + "' fill-opacity='0.15' stroke='" + colour +
         "' stroke-width='1.5'/>\n";
}

}  // namespace

std::string asSvg(const Figure& figure) {
  const Axes axes(figure);
  std::string svg = format(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %.0f %.0f' font-family='sans-serif' "
      "font-size='11'>\n"
      "<rect width='100%%' height='100%%' fill='white'/>\n",
      kWidth, kHeight);
  svg += "<text x='60' y='18' font-size='13'>" + figure.title + "</text>\n" + grid(figure, axes);
  double x = kLeft;
  for (std::size_t i = 0; i < figure.series.size(); ++i) {
    const char* colour = kColours[i % kColours.size()];
    svg += curve(figure.series[i], axes, figure, colour);
    svg +=
        format("<text x='%.0f' y='33' fill='%s'>&#9632; ", x, colour) + figure.series[i].label + "</text>\n";
    x += 30 + 6.5 * static_cast<double>(figure.series[i].label.size());
  }
  return svg + "</svg>\n";
}

}  // namespace hapticd::bench
