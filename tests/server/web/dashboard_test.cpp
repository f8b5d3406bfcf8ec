// The Grafana dashboard in packaging/ may only query metrics that the server exports.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "exposition.h"
#include "server/web/state_report.h"

namespace hapticd::server {
namespace {

StateReport everything() {
  StateReport report;
  DeviceStatus device;
  device.names = {"Phantom"};
  report.server.devices = {device};
  report.server.clients.resize(1);
  auto observed = std::make_shared<ObservedScene>();
  observed->description = std::make_shared<const scene::SceneDescription>();
  report.scenes = {{observed, {}}};
  report.server.scenes = {{"Phantom"}};
  return report;
}

TEST(Dashboard, EveryPanelQueriesMetricsThatTheServerExports) {
  std::ifstream file(HAPTICD_DASHBOARD);
  const nlohmann::json dashboard = nlohmann::json::parse(file);
  const test::Exposition exported(metricsText(everything()));
  const std::regex kName("\\b(?:hapticd|process)_[a-z0-9_]+");
  std::set<std::string> used;
  for (const auto& panel : dashboard.at("panels")) {
    if (panel.at("type") == "row") continue;
    ASSERT_FALSE(panel.at("targets").empty()) << panel.at("title");
    for (const auto& target : panel.at("targets")) {
      const std::string query = target.at("expr");
      const auto before = used.size();
      for (std::sregex_iterator i(query.begin(), query.end(), kName), end; i != end; ++i)
        used.insert(i->str());
      EXPECT_TRUE(used.size() > before || std::regex_search(query, kName)) << query;
    }
  }
  for (const std::string& name : used) EXPECT_EQ(exported.names().count(name), 1u) << name;
  EXPECT_GE(used.size(), 15u);
}

}  // namespace
}  // namespace hapticd::server
