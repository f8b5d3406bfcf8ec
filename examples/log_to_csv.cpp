// Writes all reports of a device to standard output as CSV, one row per report, with the time stamp of the
// server.
//   log_to_csv [NAME@host] [seconds] > session.csv
#include <cstdio>
#include <cstdlib>
#include <initializer_list>

#include "hapticd/client.h"

namespace {

void row(hapticd::Time time, const char* what, std::initializer_list<double> values) {
  std::printf("%.6f,%s", std::chrono::duration<double>(time.time_since_epoch()).count(), what);
  for (const double v : values) std::printf(",%.9g", v);
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) try {
  hapticd::Client client(argc > 1 ? argv[1] : "Phantom@localhost");
  std::printf("time_s,report,values\n");
  client.onPose([](const hapticd::PoseReport& r) {
    const auto& p = r.position_m;
    const auto& q = r.orientation;
    row(r.time, "pose", {static_cast<double>(r.sensor), p[0], p[1], p[2], q[0], q[1], q[2], q[3]});
  });
  client.onForce([](const hapticd::ForceReport& r) {
    row(r.time, "force", {r.force_N[0], r.force_N[1], r.force_N[2]});
  });
  client.onDepth([](const hapticd::DepthReport& r) { row(r.time, "depth", {r.depth_m}); });
  client.onContactPoint([](const hapticd::ContactPointReport& r) {
    row(r.time, "contact_point", {r.position_m[0], r.position_m[1], r.position_m[2]});
  });
  client.onTouching(
      [](const hapticd::TouchingReport& r) { row(r.time, "touching", {r.touching ? 1.0 : 0.0}); });
  client.onTouchedObject(
      [](const hapticd::TouchedObjectReport& r) { row(r.time, "object", {static_cast<double>(r.object)}); });
  client.onAngle([](const hapticd::AngleReport& r) { row(r.time, "angle", {r.angle_deg}); });
  client.onButton([](const hapticd::ButtonReport& r) {
    row(r.time, "button", {static_cast<double>(r.button), r.pressed ? 1.0 : 0.0});
  });
  client.onForceError(
      [](const hapticd::ForceErrorReport& r) { row(r.time, "force_error", {static_cast<double>(r.error)}); });
  client.onConnection([](const hapticd::ConnectionReport& r) {
    std::fprintf(stderr, "log_to_csv: %s\n", r.connected ? "connected" : r.reason.c_str());
  });
  client.runFor(std::chrono::milliseconds(argc > 2 ? static_cast<int>(1000 * std::atof(argv[2])) : 10000));
} catch (const std::exception& error) {
  std::fprintf(stderr, "log_to_csv: %s\n", error.what());
  return 1;
}
