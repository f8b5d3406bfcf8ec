// hapticd plot: a figure of a recording: force, depth and speed over time with its events, and force over
// depth.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/printable.h"
#include "base/time.h"
#include "commands.h"
#include "figure.h"
#include "record/export_file.h"
#include "record/recording_reader.h"

namespace hapticd::apps {
namespace {

struct PlotOptions {
  std::string recording;
  std::string out;
  std::string device;
  double from_s = 0;
  double to_s = 0;
  bool force = false;
};

struct Row {
  double time_s, force_N, rendered_N, depth_mm, speed_mm_per_s, normal_N;
  bool touching;
};

struct Moment {
  double time_s;
  std::string text;
  bool trip;
};

struct Data {
  std::string device;
  std::string title;
  std::vector<Row> rows;
  std::vector<Moment> moments;
  std::string remark;  // why the recording is not whole
};

constexpr const char* kForce = "#c2410c";
constexpr const char* kGrey = "#9aa4b0";
constexpr const char* kBlue = "#1d5fa8";
constexpr const char* kGreen = "#1a7f5a";
constexpr const char* kRed = "#b42318";
constexpr const char* kInk = "#15191f";
constexpr const char* kGrid = "#e3e7ec";

std::uint32_t deviceNamed(const record::RecordingHeader& header, const std::string& name) {
  if (header.devices.empty()) throw std::runtime_error("the recording has no device");
  if (name.empty()) return 0;
  std::string known;
  for (std::uint32_t i = 0; i < header.devices.size(); ++i) {
    for (const std::string& each : header.devices[i].names) {
      if (each == name) return i;
      known += (known.empty() ? "" : ", ") + base::printable(each);
    }
  }
  throw std::runtime_error("the recording has no device '" + name + "'; it has " + known);
}

// The first tick of any device: seconds count from it, as those of 'hapticd info' do.
base::Nanos beginOf(const std::string& recording) {
  record::RecordingReader reader(recording);
  std::optional<base::Nanos> first;
  for (record::RecordingEvent event; reader.next(event);) {
    if (const auto* tick = std::get_if<record::TickEvent>(&event))
      first = std::min(first.value_or(tick->tick.report.time), tick->tick.report.time);
  }
  return first.value_or(0);
}

Data read(const PlotOptions& options) {
  record::RecordingReader reader(options.recording);
  const std::uint32_t device = deviceNamed(reader.header(), options.device);
  Data data;
  data.device = base::printable(reader.header().devices[device].names.front());
  data.title = options.recording.substr(options.recording.rfind('/') + 1) + ", " + data.device;
  const base::Nanos first = beginOf(options.recording);
  std::uint32_t trips = 0;
  std::vector<std::pair<base::Nanos, std::string>> markers;
  for (record::RecordingEvent event; reader.next(event);) {
    if (const auto* marker = std::get_if<record::MarkerEvent>(&event))
      markers.emplace_back(marker->time, marker->text);
    const auto* tick = std::get_if<record::TickEvent>(&event);
    if (tick == nullptr || tick->device != device) continue;
    const realtime::TickReport& report = tick->tick.report;
    const double time_s = base::toSeconds(report.time - first);
    if (time_s < options.from_s || (options.to_s > 0 && time_s > options.to_s)) continue;
    const realtime::Rendering& r = report.rendering;
    data.rows.push_back({time_s, report.force_N.norm(), r.force_N.norm(), r.touching ? 1e3 * r.depth_m : 0,
                         1e3 * report.device.velocity_m_per_s.norm(), r.contactForce_N.dot(r.normal),
                         r.touching});
    const std::uint32_t now =
        (report.guard.active | report.guard.latched) & ~realtime::tripsOf(realtime::TripAction::clamp);
    for (const realtime::TripInfo& trip : realtime::kTrips) {
      if ((now & ~trips & realtime::bit(trip.trip)) != 0)
        data.moments.push_back({time_s, std::string(trip.name), true});
    }
    trips = now;
  }
  if (data.rows.size() < 2) {
    throw std::runtime_error(options.recording + " has no ticks of '" + data.device +
                             "' in this time; see 'hapticd info'");
  }
  for (const auto& [time, text] : markers) {
    const double time_s = base::toSeconds(time - first);
    if (time_s >= data.rows.front().time_s && time_s <= data.rows.back().time_s)
      data.moments.push_back({time_s, text, false});
  }
  data.remark = reader.remark();
  if (!data.remark.empty()) std::fprintf(stderr, "hapticd: %s\n", data.remark.c_str());
  return data;
}

// A round number of at least this, in steps of 1, 2, 5.
double roundStep(double least) {
  const double power = std::pow(10, std::floor(std::log10(least)));
  for (const double m : {1.0, 2.0, 5.0}) {
    if (m * power >= least * (1 - 1e-9)) return m * power;
  }
  return 10 * power;
}

std::string label(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// One pair of axes.
struct Axes {
  double left, top, width, height, x0, x1, y1;

  double x(double value) const { return left + (value - x0) / (x1 - x0) * width; }
  double y(double value) const { return top + height - value / y1 * height; }

  void draw(Figure& figure, const std::string& yName, const std::string& xName) const {
    const double yStep = roundStep(y1 / 4);
    for (double v = 0; v <= y1 * 1.001; v += yStep) {
      figure.line({{left, y(v)}, {left + width, y(v)}}, kGrid, 0.7);
      figure.text(left - 5, y(v) + 3, label(v), 9, kInk, Figure::Anchor::end);
    }
    const double xStep = roundStep((x1 - x0) / 8);
    for (double v = std::ceil(x0 / xStep) * xStep; v <= x1 + 1e-9 * xStep; v += xStep) {
      figure.line({{x(v), top + height}, {x(v), top + height + 3}}, kInk, 0.7);
      if (!xName.empty()) figure.text(x(v), top + height + 13, label(v), 9, kInk, Figure::Anchor::middle);
    }
    figure.line({{left, top}, {left, top + height}, {left + width, top + height}}, kInk, 0.8);
    figure.text(left - 40, top + height / 2, yName, 10, kInk, Figure::Anchor::middle, true);
    if (!xName.empty())
      figure.text(left + width / 2, top + height + 27, xName, 10, kInk, Figure::Anchor::middle);
  }
};

// At most two points for each column of the picture, so that no peak is lost.
void curve(Figure& figure, const Axes& axes, const std::vector<Row>& rows, double Row::*value,
           const std::string& colour, double width) {
  std::vector<std::pair<double, double>> points;
  const auto columns = static_cast<std::size_t>(2 * axes.width);
  const std::size_t step = std::max<std::size_t>(1, rows.size() / columns);
  for (std::size_t i = 0; i < rows.size(); i += step) {
    const auto begin = rows.begin() + static_cast<std::ptrdiff_t>(i);
    const auto end = rows.begin() + static_cast<std::ptrdiff_t>(std::min(i + step, rows.size()));
    auto [low, high] =
        std::minmax_element(begin, end, [value](const Row& a, const Row& b) { return a.*value < b.*value; });
    if (high < low) std::swap(low, high);
    points.emplace_back(axes.x(low->time_s), axes.y((*low).*value));
    if (high != low) points.emplace_back(axes.x(high->time_s), axes.y((*high).*value));
  }
  figure.line(points, colour, width);
}

double endOf(const std::vector<Row>& rows, double Row::*value, double least) {
  double most = least;
  for (const Row& row : rows) most = std::max(most, row.*value);
  const double step = roundStep(most / 4);
  return step * std::ceil(most / step * (1 - 1e-9));
}

void addEvents(Figure& figure, const Data& data, const Axes& axes, double bottom) {
  double freeFrom = 0;
  std::vector<Moment> moments = data.moments;
  std::sort(moments.begin(), moments.end(),
            [](const Moment& a, const Moment& b) { return a.time_s < b.time_s; });
  for (const Moment& moment : moments) {
    const double x = axes.x(moment.time_s);
    const char* colour = moment.trip ? kRed : kBlue;
    figure.line({{x, axes.top - 4}, {x, bottom}}, colour, 0.8);
    if (x < freeFrom) continue;  // its text would cover the previous one
    const std::string_view text = base::beginning(moment.text, 40);
    figure.text(x + 2, axes.top - 6, text, 8, colour);
    freeFrom = x + 4.6 * static_cast<double>(text.size()) + 6;
  }
}

// Contact as a bar below the curves.
void addContacts(Figure& figure, const Data& data, const Axes& axes, double top) {
  for (std::size_t i = 0; i < data.rows.size();) {
    if (!data.rows[i].touching) {
      ++i;
      continue;
    }
    const std::size_t begin = i;
    while (i < data.rows.size() && data.rows[i].touching) ++i;
    const double x = axes.x(data.rows[begin].time_s);
    figure.rectangle(x, top, std::max(0.4, axes.x(data.rows[i - 1].time_s) - x), 5, kGreen);
  }
  figure.text(axes.left - 5, top + 6, "contact", 8, kGreen, Figure::Anchor::end);
}

// The stiffness that fits normal force over depth best, through the origin. N/m.
double fittedStiffness(const std::vector<Row>& rows) {
  double product = 0;
  double square = 0;
  for (const Row& row : rows) {
    if (!row.touching) continue;
    product += row.normal_N * row.depth_mm * 1e-3;
    square += row.depth_mm * row.depth_mm * 1e-6;
  }
  return square > 0 ? product / square : 0;
}

void addStiffness(Figure& figure, const Data& data, Axes axes) {
  axes.x0 = 0;
  axes.x1 = endOf(data.rows, &Row::depth_mm, 0.1);
  axes.y1 = endOf(data.rows, &Row::normal_N, 0.1);
  axes.draw(figure, "normal force, N", "depth, mm");
  std::set<std::pair<long, long>> cells;  // a dot of one point each, however many ticks are in it
  for (const Row& row : data.rows) {
    if (row.touching && row.normal_N >= 0)
      cells.emplace(std::lround(axes.x(row.depth_mm)), std::lround(axes.y(row.normal_N)));
  }
  for (const auto& [x, y] : cells)
    figure.rectangle(static_cast<double>(x) - 0.6, static_cast<double>(y) - 0.6, 1.2, 1.2, kForce);
  const double k_N_per_m = fittedStiffness(data.rows);
  if (k_N_per_m <= 0) return figure.text(axes.left + 8, axes.top + 12, "no contact", 10, kInk);
  const double reach_mm = std::min(axes.x1, 1e3 * axes.y1 / k_N_per_m);
  figure.line({{axes.x(0), axes.y(0)}, {axes.x(reach_mm), axes.y(k_N_per_m * reach_mm * 1e-3)}}, kBlue, 1);
  figure.text(axes.left + 8, axes.top + 12, "fit: " + label(std::round(k_N_per_m)) + " N/m", 10, kBlue);
}

Figure draw(const Data& data) {
  constexpr double kLeft = 62;
  constexpr double kWidth = 620;
  constexpr double kHeight = 96;
  Figure figure(kLeft + kWidth + 24, 690);
  figure.text(kLeft, 18, data.title, 12, kInk);
  Axes axes{kLeft, 48, kWidth, kHeight, data.rows.front().time_s, data.rows.back().time_s, 1};
  const Axes top = axes;
  axes.y1 = std::max(endOf(data.rows, &Row::force_N, 0.1), endOf(data.rows, &Row::rendered_N, 0.1));
  axes.draw(figure, "force, N", "");
  curve(figure, axes, data.rows, &Row::rendered_N, kGrey, 0.8);
  curve(figure, axes, data.rows, &Row::force_N, kForce, 1.1);
  figure.text(kLeft + kWidth, 30, "orange: written, grey: rendered before the guard", 8, kInk,
              Figure::Anchor::end);
  axes.top += kHeight + 24;
  axes.y1 = endOf(data.rows, &Row::depth_mm, 0.1);
  axes.draw(figure, "depth, mm", "");
  curve(figure, axes, data.rows, &Row::depth_mm, kGreen, 1.1);
  axes.top += kHeight + 24;
  axes.y1 = endOf(data.rows, &Row::speed_mm_per_s, 1);
  axes.draw(figure, "speed, mm/s", "time, s");
  curve(figure, axes, data.rows, &Row::speed_mm_per_s, kBlue, 1.1);
  addContacts(figure, data, axes, axes.top + kHeight + 34);
  addEvents(figure, data, top, axes.top + kHeight);
  axes.top += kHeight + 62;
  axes.height = 170;
  axes.width = 300;
  addStiffness(figure, data, axes);
  return figure;
}

int run(const PlotOptions& options) {
  const bool pdf = options.out.ends_with(".pdf");
  if (!pdf && !options.out.ends_with(".svg"))
    throw std::runtime_error("'" + options.out + "' must end with .svg or .pdf");
  if (options.to_s > 0 && options.to_s <= options.from_s)
    throw std::runtime_error("--to must be greater than --from, " + label(options.from_s) +
                             ", or 0 for the end; got " + label(options.to_s));
  keepFile(options.out, options.force);
  record::ExportFile file(options.out, record::Unfinished::dropped);
  const Data data = read(options);
  const Figure figure = draw(data);
  const std::string text = pdf ? figure.pdf(data.title) : figure.svg(data.title);
  file.write(text);
  file.close();
  std::printf("%s: %zu ticks of '%s' from %.3f s to %.3f s\n", options.out.c_str(), data.rows.size(),
              data.device.c_str(), data.rows.front().time_s, data.rows.back().time_s);
  return statusFor(data.remark);
}

}  // namespace

void addPlot(CLI::App& app) {
  auto options = std::make_shared<PlotOptions>();
  CLI::App* command = app.add_subcommand("plot", "Draw a recording: force, depth, speed, events, stiffness");
  command->add_option("file", options->recording, "Recording of 'hapticd serve --record'")
      ->required()
      ->check(existingFile());
  command->add_option("-o,--out", options->out, "*.svg or *.pdf")->required();
  command->add_option("--device", options->device, "Name of a device [the first]");
  command->add_option("--from", options->from_s, "First second")
      ->check(within(0, kLongest_s))
      ->capture_default_str();
  command->add_option("--to", options->to_s, "Last second; 0: the end")
      ->check(within(0, kLongest_s))
      ->capture_default_str();
  command->add_flag("--force", options->force, kForceText);
  command->footer(
      "Vertical lines mark trips of the guard (red) and markers of clients (blue). The last picture is the "
      "normal\n"
      "force over the depth, with the stiffness that fits it best.\n"
      "Example: hapticd plot my.haptics --out stroke.svg --from 2 --to 5");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps
