#include "render_recording.h"

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "record/difference.h"

namespace hapticd::apps {
namespace {

using record::Difference;

void writeFile(const std::string& name, const std::string& text) {
  std::ofstream out(name);
  out << text;
  out.close();
  if (!out)
    throw std::runtime_error("cannot write '" + name + "': name a file in a directory that can be written");
}

std::string csv(const std::vector<Difference>& devices) {
  std::string text = "device,t_s,force_N,force_now_N,depth_m,depth_now_m\n";
  char row[200];
  for (const Difference& device : devices) {
    for (const record::DifferencePoint& p : device.points()) {
      std::snprintf(row, sizeof row, ",%.9f,%.17g,%.17g,%.17g,%.17g\n", p.time_s, p.force_N, p.forceNow_N,
                    p.depth_m, p.depthNow_m);
      text += device.device() + row;
    }
  }
  return text;
}

void print(const Difference& d) {
  std::printf("device      %s: %llu ticks, %llu touching then or now\n", d.device().c_str(),
              static_cast<unsigned long long>(d.ticks()), static_cast<unsigned long long>(d.touching()));
  if (d.lost() > 0)
    std::printf("not recorded %llu ticks: from there on the forces need not be the same\n",
                static_cast<unsigned long long>(d.lost()));
  std::printf("same        %llu ticks in every bit%s\n", static_cast<unsigned long long>(d.same()),
              d.same() == d.ticks() ? ": all of them" : "");
  std::printf("force       differs by %.4g N at most (at %.3f s), by %.4g N on the mean while touching\n",
              d.largest_N(), d.largestAt_s(), d.mean_N());
  std::printf("depth       differs by %.4g mm at most, by %.4g mm on the mean while touching\n",
              d.largestDepth_m() * 1e3, d.meanDepth_m() * 1e3);
}

}  // namespace

int renderSession(const RecordingRenderOptions& options) {
  std::string remark;
  const std::vector<Difference> devices = record::compare(options.session, options.changes, remark);
  std::printf("session     %s\nchanged     %s\n", options.session.c_str(),
              record::inWords(options.changes).c_str());
  bool same = true;
  for (const Difference& device : devices) {
    print(device);
    same = same && device.same() == device.ticks();
  }
  if (!options.out.empty()) writeFile(options.out, csv(devices));
  if (!options.report.empty()) {
    writeFile(options.report, record::htmlReport(options.session, options.changes, devices, remark));
    std::printf("report      %s\n", options.report.c_str());
  }
  if (!remark.empty()) std::fprintf(stderr, "hapticd: %s\n", remark.c_str());
  if (same || !options.changes.none()) return 0;
  std::fprintf(
      stderr,
      "hapticd: nothing was changed, and yet the forces differ: the session is of another version or another "
      "machine, or ticks were lost\n");
  return 1;
}

}  // namespace hapticd::apps
