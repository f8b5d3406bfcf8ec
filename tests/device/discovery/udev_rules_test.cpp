// packaging/udev/70-hapticd.rules: whether udev would understand it, and whether it is about the devices that
// the drivers look for.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <regex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "device/discovery/usb_devices.h"

namespace hapticd::device {
namespace {

struct Part {
  std::string key, operation, value;
};
using Rule = std::vector<Part>;

std::vector<std::string> linesOf(const char* file) {
  std::vector<std::string> lines;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line[0] != '#') lines.push_back(line);
  }
  return lines;
}

// KEY{attribute}OP"value", with a comma between; empty when the line is anything else.
Rule parse(const std::string& line) {
  static const std::regex part(R"re(\s*([A-Z]+(?:\{[A-Za-z_]+\})?)(==|!=|\+=|:=|=)"([^"]*)"\s*(,|$))re");
  Rule rule;
  auto at = line.cbegin();
  for (std::smatch found; at != line.cend(); at = found[0].second) {
    if (!std::regex_search(at, line.cend(), found, part, std::regex_constants::match_continuous)) return {};
    rule.push_back({found[1], found[2], found[3]});
  }
  return rule;
}

std::string valueOf(const Rule& rule, const std::string& key, const std::string& operation) {
  for (const Part& part : rule) {
    if (part.key == key && part.operation == operation) return part.value;
  }
  return {};
}

class UdevRules : public testing::Test {
 protected:
  UdevRules() {
    for (const std::string& line : linesOf(UDEV_RULES)) rules.push_back(parse(line));
  }
  std::vector<Rule> rules;
};

TEST_F(UdevRules, EachMatchesSomethingAndGivesRights) {
  ASSERT_FALSE(rules.empty());
  const std::set<std::string> matches{"SUBSYSTEM",       "KERNEL",           "ATTR{idVendor}",
                                      "ATTRS{idVendor}", "ATTRS{idProduct}", "ENV{ID_INPUT_JOYSTICK}"};
  const std::vector<std::string> lines = linesOf(UDEV_RULES);
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const Rule& rule = rules[i];
    ASSERT_FALSE(rule.empty()) << lines[i];
    for (const Part& part : rule) {
      const bool isMatch = part.operation == "==";
      EXPECT_TRUE(!isMatch || matches.count(part.key) == 1) << part.key << " in " << lines[i];
    }
    EXPECT_NE(valueOf(rule, "SUBSYSTEM", "=="), "") << lines[i];
    EXPECT_EQ(valueOf(rule, "MODE", "="), "0660") << "nobody else may move an arm: " << lines[i];
    EXPECT_EQ(valueOf(rule, "GROUP", "="), "plugdev") << lines[i];
    EXPECT_EQ(valueOf(rule, "TAG", "+="), "uaccess") << lines[i];
  }
}

TEST_F(UdevRules, AreReadBeforeTheRightsOfThePersonAtTheMachineAreGiven) {
  const std::string path = UDEV_RULES;
  const std::string name = path.substr(path.rfind('/') + 1);
  EXPECT_LT(name, "73-seat-late.rules");
}

// Vendor and product as the rules and the drivers have them, both ways.
TEST_F(UdevRules, AreAboutTheDevicesThatTheDriversLookFor) {
  std::set<std::pair<std::string, std::string>> ruled;
  for (const Rule& rule : rules) {
    std::string vendor = valueOf(rule, "ATTR{idVendor}", "==");
    if (vendor.empty()) vendor = valueOf(rule, "ATTRS{idVendor}", "==");
    if (!vendor.empty()) ruled.emplace(vendor, valueOf(rule, "ATTRS{idProduct}", "=="));
  }
  std::set<std::pair<std::string, std::string>> wanted;
  for (const UsbKind& kind : kUsbKinds) wanted.emplace(kind.vendor, kind.product);
  EXPECT_EQ(ruled, wanted);
}

TEST_F(UdevRules, ReachJoysticksThroughTheirEventFiles) {
  EXPECT_TRUE(std::any_of(rules.begin(), rules.end(), [](const Rule& rule) {
    return valueOf(rule, "SUBSYSTEM", "==") == "input" && valueOf(rule, "KERNEL", "==") == "event*" &&
           valueOf(rule, "ENV{ID_INPUT_JOYSTICK}", "==") == "1";
  }));
}

TEST(UdevRuleParser, RefusesWhatUdevWould) {
  EXPECT_EQ(parse(R"(SUBSYSTEM=="usb", MODE="0660")").size(), 2U);
  EXPECT_TRUE(parse(R"(SUBSYSTEM="usb" MODE="0660")").empty()) << "a comma is missing";
  EXPECT_TRUE(parse(R"(SUBSYSTEM==usb)").empty());
  EXPECT_TRUE(parse(R"(subsystem=="usb")").empty());
  EXPECT_TRUE(parse("nonsense").empty());
}

}  // namespace
}  // namespace hapticd::device
