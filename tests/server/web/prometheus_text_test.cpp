#include "server/web/prometheus_text.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/time.h"
#include "exposition.h"
#include "server/web/state_report.h"

namespace hapticd::server {
namespace {

using test::Exposition;

TEST(PrometheusText, WritesHeadersAndSamples) {
  PrometheusText out;
  out.family("a_total", "counter", "Things.");
  out.sample(3, {{"device", "Phantom"}, {"trip", "speed"}});
  out.family("b", "gauge", "Others.");
  out.sample(0.25);
  EXPECT_EQ(out.text(),
            "# HELP a_total Things.\n# TYPE a_total counter\na_total{device=\"Phantom\",trip=\"speed\"} 3\n"
            "# HELP b Others.\n# TYPE b gauge\nb 0.25\n");
}

TEST(PrometheusText, EscapesLabels) {
  PrometheusText out;
  out.family("a", "gauge", "Things.");
  out.sample(1, {{"device", "two\nlines \"quoted\" \\"}});
  EXPECT_NE(out.text().find("a{device=\"two\\nlines \\\"quoted\\\" \\\\\"} 1\n"), std::string::npos);
}

// Prometheus refuses all of a server's numbers for one byte that is not UTF-8.
TEST(PrometheusText, MakesLabelsUtf8) {
  PrometheusText out;
  out.family("a", "gauge", "Things.");
  out.sample(1, {{"device", "Gr\xf6\xc3\xa4"}});
  EXPECT_NE(out.text().find("a{device=\"Gr\xef\xbf\xbd\xc3\xa4\"} 1\n"), std::string::npos);
}

TEST(PrometheusText, WritesNonFiniteNumbers) {
  PrometheusText out;
  out.family("a", "gauge", "Things.");
  out.sample(std::numeric_limits<double>::quiet_NaN());
  out.sample(std::numeric_limits<double>::infinity());
  out.sample(1e-9);
  EXPECT_NE(out.text().find("a NaN\na +Inf\na 1e-09\n"), std::string::npos);
}

TEST(PrometheusText, HistogramBucketsAreCumulative) {
  base::Histogram histogram;
  for (const base::Nanos value : {0, 1023, 1024, 2047, 5000, 1'000'000}) histogram.add(value);
  histogram.add(base::Nanos{1} << 29);
  histogram.add(base::Nanos{1} << 34);
  PrometheusText out;
  out.family("t_seconds", "histogram", "Times.");
  out.histogram(histogram.copy(), "P");
  const Exposition read(out.text());
  const auto upTo = [&](const std::string& bound) {
    return read.value("t_seconds_bucket{device=\"P\",le=\"" + bound + "\"}");
  };
  EXPECT_EQ(upTo("1.023e-06"), 2);
  EXPECT_EQ(upTo("2.047e-06"), 4);
  EXPECT_EQ(upTo("4.095e-06"), 4);
  EXPECT_EQ(upTo("8.191e-06"), 5);
  EXPECT_EQ(upTo("0.001048575"), 6);
  EXPECT_EQ(upTo("0.536870911"), 6);
  EXPECT_EQ(upTo("+Inf"), 8);
  EXPECT_EQ(read.value("t_seconds_count{device=\"P\"}"), 8);
  EXPECT_EQ(read.problems(), std::vector<std::string>{});
}

TEST(Metrics, AreWellFormedForAServerWithOddNames) {
  StateReport report;
  report.version = "1.2.3";
  DeviceStatus device;
  device.names = {"a \"quoted\"\nname"};
  device.last.force_N = {0, 3, 4};
  device.last.guard.limit_N = 10;
  device.last.guard.counts[static_cast<std::size_t>(realtime::Trip::speed)] = 7;
  report.server.devices = {device, device};
  report.server.devices[1].names = {"B"};
  ClientStatus client;
  client.id = 3;
  client.address = "127.0.0.1:4000";
  client.mode = "web";
  client.queuedBytes = 5;
  client.unacknowledgedBytes = 6;
  report.server.clients = {client};
  const Exposition read(metricsText(report));
  EXPECT_EQ(read.problems(), std::vector<std::string>{});
  EXPECT_EQ(read.value("hapticd_build_info{version=\"1.2.3\"}"), 1);
  EXPECT_EQ(read.value("hapticd_force_newtons{device=\"B\"}"), 5);
  EXPECT_EQ(read.value("hapticd_force_saturation_ratio{device=\"B\"}"), 0.5);
  EXPECT_EQ(read.value("hapticd_guard_trips_total{device=\"B\",trip=\"speed\"}"), 7);
  EXPECT_EQ(read.value("hapticd_client_lag_bytes{client=\"3\",address=\"127.0.0.1:4000\",mode=\"web\"}"), 11);
  EXPECT_GT(read.value("process_resident_memory_bytes"), 1e6);
  EXPECT_GT(read.value("process_open_fds"), 2);
}

}  // namespace
}  // namespace hapticd::server
