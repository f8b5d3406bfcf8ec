// The dashboard that comes with the server must ask for what the server tells.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "exposition.h"
#include "server/web/picture.h"

namespace hapticd::server {
namespace {

Picture everything() {
  Picture picture;
  DeviceStatus device;
  device.names = {"Phantom"};
  picture.server.devices = {device};
  picture.server.clients.resize(1);
  auto view = std::make_shared<SceneView>();
  view->description = std::make_shared<const scene::SceneDescription>();
  picture.scenes = {{view, {}}};
  picture.server.scenes = {{"Phantom"}};
  return picture;
}

TEST(Dashboard, EveryMetricItNamesExistsAndEveryPanelHasOne) {
  std::ifstream file(HAPTICD_DASHBOARD);
  const nlohmann::json dashboard = nlohmann::json::parse(file);
  const test::Exposition told(metricsText(everything()));
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
  for (const std::string& name : used) EXPECT_EQ(told.names().count(name), 1u) << name;
  EXPECT_GE(used.size(), 15u);
}

}  // namespace
}  // namespace hapticd::server
