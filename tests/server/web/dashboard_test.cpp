// The Grafana dashboard in packaging/ may only query metrics that the server exports; docs/monitoring.md
// names all of them.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

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

TEST(Monitoring, ThePageNamesEveryMetricAndNoOther) {
  std::ifstream file(HAPTICD_TESTDATA "/../docs/monitoring.md");
  const std::string page((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::regex kName("`((?:hapticd|process)_[a-z0-9_]+)`");
  std::set<std::string> named;
  for (std::sregex_iterator i(page.begin(), page.end(), kName), end; i != end; ++i) named.insert((*i)[1]);
  std::set<std::string> exported;
  const test::Exposition read(metricsText(everything()));
  for (const auto& [name, type] : read.types()) exported.insert(name);
  EXPECT_EQ(named, exported);
}

}  // namespace
}  // namespace hapticd::server
