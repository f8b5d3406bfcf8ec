#include "render_recording.h"

#include <cstdio>
#include <optional>

#include "base/printable.h"
#include "commands.h"
#include "record/difference.h"
#include "record/export_file.h"
#include "record/text_fields.h"

namespace hapticd::apps {
namespace {

using record::Difference;

// Created before the work, so that a name that cannot be written is refused at once.
class ResultFile {
 public:
  explicit ResultFile(const std::string& name) {
    if (!name.empty()) file_.emplace(name, record::Unfinished::dropped);
  }
  void write(const std::string& text) {
    file_->write(text);
    file_->close();
  }

 private:
  std::optional<record::ExportFile> file_;
};

// One row of the CSV.
struct DifferenceRow {
  std::string device;
  record::DifferencePoint point;
};

template <class V>
void fields(const DifferenceRow& row, V&& v) {
  v("device", row.device);
  v("t_s", row.point.time_s);
  v("force_N", row.point.force_N);
  v("force_now_N", row.point.forceNow_N);
  v("depth_m", row.point.depth_m);
  v("depth_now_m", row.point.depthNow_m);
}

std::string csv(const std::vector<Difference>& devices) {
  std::string text = record::csvHeader<DifferenceRow>();
  for (const Difference& device : devices) {
    for (const record::DifferencePoint& point : device.points())
      record::appendCsvRow(text, DifferenceRow{device.device(), point});
  }
  return text;
}

void print(const Difference& d) {
  std::printf("device      %s: %llu ticks, %llu touching in either\n", base::printable(d.device()).c_str(),
              static_cast<unsigned long long>(d.ticks()), static_cast<unsigned long long>(d.touching()));
  if (d.skipped() > 0)
    std::printf(
        "not compared %llu ticks: what held, moved, ramped or was streamed before is not in the file\n",
        static_cast<unsigned long long>(d.skipped()));
  if (d.lost() > 0)
    std::printf("not recorded %llu ticks: the ticks after them may differ\n",
                static_cast<unsigned long long>(d.lost()));
  std::printf("same        %llu ticks in every bit%s\n", static_cast<unsigned long long>(d.same()),
              d.same() == d.ticks() && d.ticks() > 0 ? ": all of them" : "");
  std::printf("force       differs by at most %.4g N (at %.3f s), on average by %.4g N while touching\n",
              d.largest_N(), d.largestAt_s(), d.mean_N());
  std::printf("depth       differs by at most %.4g mm, on average by %.4g mm while touching\n",
              d.largestDepth_m() * 1e3, d.meanDepth_m() * 1e3);
}

// Why no tick was compared; empty when some were.
std::string nothingComparedIn(const std::vector<Difference>& devices) {
  std::uint64_t skipped = 0;
  for (const Difference& d : devices) {
    if (d.ticks() > 0) return {};
    skipped += d.skipped();
  }
  if (skipped == 0) return "no tick could be compared: the recording has none; see 'hapticd info'";
  return "no tick could be compared: there was none free of contact, movement, ramps and streamed forces";
}

// Why the recording does not show that the forces are the same; empty when it does.
std::string failureOf(const std::vector<Difference>& devices) {
  for (const Difference& d : devices) {
    if (d.same() == d.ticks()) continue;
    std::string text = "nothing was changed, but ticks of " + base::printable(d.device()) + " differ: ";
    if (!d.complete()) return text + "the recorder lost some of what made them";
    if (!d.knowsPast()) {
      text +=
          "the recording began while the server ran, and the version that wrote it left out the effects, "
          "planes "
          "and thermal limit of that moment; or ";
    }
    return text + "another version or another kind of machine wrote the recording";
  }
  return {};
}

}  // namespace

int renderSession(const RecordingRenderOptions& options) {
  ResultFile out(options.out);
  ResultFile report(options.report);
  std::string remark;
  std::string law;
  const std::vector<Difference> devices = record::compare(options.session, options.changes, remark, law);
  std::printf("session     %s\nchanged     %s\n", options.session.c_str(),
              record::describe(options.changes).c_str());
  if (!law.empty()) std::printf("force law   %s\n", law.c_str());
  for (const Difference& device : devices) print(device);
  if (!options.out.empty()) out.write(csv(devices));
  if (!options.report.empty()) {
    report.write(record::htmlReport(options.session, options.changes, devices, remark));
    std::printf("report      %s\n", options.report.c_str());
  }
  if (!remark.empty()) std::fprintf(stderr, "hapticd: %s\n", remark.c_str());
  std::string failure = nothingComparedIn(devices);
  // Another law gives other forces on purpose: the largest difference above is the result, not a failure.
  if (failure.empty() && options.changes.none() && law.empty()) failure = failureOf(devices);
  if (failure.empty()) return statusFor(remark);
  std::fprintf(stderr, "hapticd: %s\n", failure.c_str());
  return 1;
}

}  // namespace hapticd::apps
