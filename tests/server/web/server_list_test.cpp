#include "server/web/server_list.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/fake_world.h"

namespace hapticd::server {
namespace {

using nlohmann::json;

json jsonOf(NetworkSearch search) {
  return json::parse(serversJson(std::move(search)));
}

TEST(ServersJson, HasEveryFieldThePageReads) {
  const NetworkServer lab{.name = "hapticd on lab7",
                          .address = "10.0.0.7",
                          .port = 3884,
                          .devices = {"Phantom@10.0.0.7:3884", "Left@10.0.0.7:3884"},
                          .page = "http://10.0.0.7:8080/",
                          .tls = false,
                          .version = "1.2.3",
                          .thisServer = true};
  EXPECT_EQ(jsonOf({.servers = {lab}}), json::parse(R"({"servers": [{
    "name": "hapticd on lab7", "address": "10.0.0.7", "port": 3884,
    "devices": ["Phantom@10.0.0.7:3884", "Left@10.0.0.7:3884"], "page": "http://10.0.0.7:8080/",
    "tls": false, "version": "1.2.3", "this_server": true}], "reason": ""})"));
}

TEST(ServersJson, NamesOfAnyBytesGiveValidJson) {
  const json found = jsonOf({.servers = {{.name = "\xff\"</script>\n"}}, .reason = "\xfe"});
  EXPECT_EQ(found["servers"][0]["name"], "\uFFFD\"</script>\n");
  EXPECT_EQ(found["reason"], "\uFFFD");
}

// Any machine of the network may announce what it likes.
TEST(ServersJson, IsShortWhateverIsAnnounced) {
  NetworkServer large{.name = std::string(99, 'a') + "\u00b5" + std::string(5000, 'b'),
                      .address = std::string(5000, '1'),
                      .devices = std::vector<std::string>(500, "Phantom@10.0.0.7:3883"),
                      .page = "http://" + std::string(5000, '1'),
                      .version = std::string(5000, '1')};
  large.devices.insert(large.devices.begin(), std::string(5000, 'c'));
  NetworkSearch search{.servers = std::vector<NetworkServer>(5000, large)};
  search.servers.push_back({.name = "ours", .thisServer = true});
  const json servers = jsonOf(search)["servers"];
  ASSERT_EQ(servers.size(), kMostServers);
  EXPECT_EQ(servers[0]["name"], "ours") << "no crowd displaces it";
  EXPECT_EQ(servers[1]["name"], std::string(99, 'a')) << "not half a character";
  EXPECT_EQ(servers[1]["devices"],
            json(std::vector<std::string>(kMostDevicesOfServer, "Phantom@10.0.0.7:3883")))
      << "whole names only";
  EXPECT_EQ(servers[1]["page"], "") << "half an address leads elsewhere";
  EXPECT_LE(servers.dump().size(), 100'000U);
}

TEST(ServersJson, LinksToPagesOnly) {
  for (const char* page :
       {"javascript:alert(1)", "data:text/html,x", "ftp://10.0.0.7/", "//10.0.0.7/", "http:"})
    EXPECT_EQ(jsonOf({.servers = {{.page = page}}})["servers"][0]["page"], "") << page;
  EXPECT_EQ(jsonOf({.servers = {{.page = "https://10.0.0.7:1/"}}})["servers"][0]["page"],
            "https://10.0.0.7:1/");
}

/// Searches that end when the test says so.
class Searches {
 public:
  class Finder final : public ServerFinder {
   public:
    explicit Finder(Searches& searches) : searches_(searches) {}
    void find(Done done) override { searches_.started.push_back(std::move(done)); }

   private:
    Searches& searches_;
  };
  std::unique_ptr<ServerFinder> finder() { return std::make_unique<Finder>(*this); }

  std::vector<ServerFinder::Done> started;
};

class ServerListTest : public testing::Test {
 protected:
  void ask() {
    list.get([this](const std::string& text) { answers.push_back(json::parse(text)); });
  }
  void runPosted() {
    for (const auto& function : std::exchange(posted, {})) function();
  }
  void find(std::size_t search, const char* name) {
    searches.started.at(search)({.servers = {{.name = name}}});
    runPosted();
  }

  base::FakeWorld world;
  Searches searches;
  std::vector<std::function<void()>> posted;
  std::vector<json> answers;
  ServerList list{[this](std::function<void()> function) { posted.push_back(std::move(function)); }};
};

TEST_F(ServerListTest, OneSearchAnswersAllWhoAskMeanwhile) {
  list.searchBy(searches.finder());
  EXPECT_TRUE(searches.started.empty()) << "nobody has asked";
  for (int i = 0; i < 50; ++i) ask();
  ASSERT_EQ(searches.started.size(), 1U);
  EXPECT_TRUE(answers.empty());
  searches.started[0]({.servers = {{.name = "lab"}}});
  EXPECT_TRUE(answers.empty()) << "answered by the net thread, not by the finder's";
  runPosted();
  ASSERT_EQ(answers.size(), 50U);
  for (const json& answer : answers) EXPECT_EQ(answer["servers"][0]["name"], "lab");
}

TEST_F(ServerListTest, SearchesAgainWhenTheLastSearchIsOld) {
  list.searchBy(searches.finder());
  ask();
  find(0, "old");
  world.clock.sleepUntil(ServerList::kFresh - 1);
  ask();
  EXPECT_EQ(searches.started.size(), 1U) << "fresh";
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[1]["servers"][0]["name"], "old");
  world.clock.sleepUntil(ServerList::kFresh);
  ask();
  ask();
  ASSERT_EQ(searches.started.size(), 2U);
  EXPECT_EQ(answers.size(), 2U);
  find(1, "new");
  ASSERT_EQ(answers.size(), 4U);
  EXPECT_EQ(answers[3]["servers"][0]["name"], "new");
}

TEST_F(ServerListTest, AFailedSearchIsNotRepeatedAtOnce) {
  list.searchBy(searches.finder());
  ask();
  searches.started.at(0)({.reason = "no Avahi"});
  runPosted();
  ask();
  EXPECT_EQ(searches.started.size(), 1U);
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[1], json::parse(R"({"servers": [], "reason": "no Avahi"})"));
}

TEST_F(ServerListTest, WithoutAFinderThereIsAReason) {
  ask();
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_TRUE(answers[0]["servers"].empty());
  EXPECT_NE(answers[0]["reason"], "");
}

}  // namespace
}  // namespace hapticd::server
