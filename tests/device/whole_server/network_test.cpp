// The whole program finds the servers of the network for its page, at a scripted Avahi.
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "device/whole_server/served_device.h"
#include "net/loopback.h"
#include "zeroconf/scripted_avahi.h"

namespace hapticd::whole_server {
namespace {

using nlohmann::json;

class PageOfTheNetwork : public testing::Test {
 protected:
  void SetUp() override {
    if (!bus_.runs()) GTEST_SKIP() << "dbus-daemon is missing (packages.txt, section test)";
  }
  void serve() {
    server_.emplace(work_, std::vector<std::string>{"--http", "127.0.0.1:0"}, std::vector<std::string>{});
    ASSERT_TRUE(eventually([&] {
      const std::string log = server_->log();
      std::smatch match;
      if (!std::regex_search(log, match, std::regex("viewer: http://([0-9.:]+)/"))) return false;
      page_ = net::Endpoint::parse(match[1].str());
      return true;
    })) << server_->log();
  }
  net::RawSocket ask() const {
    net::RawSocket socket = net::RawSocket::connected(page_);
    socket.send("GET /api/servers HTTP/1.1\r\nHost: " + page_.text() + "\r\nConnection: close\r\n\r\n");
    return socket;
  }
  json found() const {
    net::RawSocket socket = ask();
    std::string answer;
    for (std::string part; !(part = socket.receiveSome()).empty();) answer += part;
    return json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  }

  test::PrivateBus bus_;
  WorkDirectory work_;
  std::optional<ServerProcess> server_;
  net::Endpoint page_;
};

TEST_F(PageOfTheNetwork, ListsTheOtherServersAndMarksItsOwn) {
  test::ScriptedAvahi avahi;
  serve();
  const net::Endpoint own = net::Endpoint::parse(server_->address());
  avahi.setOthers(
      {{{2, 0, "attic", "_hapticd._tcp", 3883, {"devices=Arm,Left", "version=9", "page=8080"}}, "10.0.0.9"},
       {{1, 0, "own", "_hapticd._tcp", own.port, {"devices=Phantom"}}, "127.0.0.1"}});
  const json search = found();
  EXPECT_EQ(search["reason"], "");
  ASSERT_EQ(search["servers"].size(), 2U) << search;
  const json& ours = search["servers"][0];
  EXPECT_EQ(ours["name"], "own");
  EXPECT_EQ(ours["this_server"], true);
  EXPECT_EQ(ours["page"], "");
  EXPECT_EQ(search["servers"][1], json::parse(R"({"name": "attic", "address": "10.0.0.9", "port": 3883,
    "devices": ["Arm@10.0.0.9:3883", "Left@10.0.0.9:3883"], "page": "http://10.0.0.9:8080/", "tls": false,
    "version": "9", "this_server": false})"));
}

TEST_F(PageOfTheNetwork, WithoutAvahiHasAReason) {
  serve();
  const json search = found();
  EXPECT_EQ(search["servers"], json::array());
  EXPECT_NE(search["reason"].get<std::string>().find("apt install avahi-daemon"), std::string::npos)
      << search;
}

TEST_F(PageOfTheNetwork, EndsInOrderDuringASearch) {
  test::ScriptedAvahi avahi;
  avahi.neverFinish();
  serve();
  const net::RawSocket waits = ask();
  ASSERT_TRUE(avahi.waitBrowsed());
  server_->signal(SIGTERM);
  EXPECT_EQ(server_->end(), 0) << server_->log();
}

}  // namespace
}  // namespace hapticd::whole_server
