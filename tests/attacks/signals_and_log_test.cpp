// Signals, and a log that nobody reads: what they leave on the motors of a driver in the server's own
// process, where no isolation host helps.
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "device/whole_server/in_contact.h"
#include "net/endpoint.h"
#include "server/scripted_peer.h"
#include "system_bus/scripted_logind.h"

namespace hapticd::whole_server {
namespace {

const std::vector<std::string> kInProcess{"--device", "openhaptics", "--in-process"};
const std::vector<std::string> kMock{"HAPTICD_HDAPI_LIB=" MOCK_HD};

class Signals : public InContact {
 protected:
  bool forceRests() {
    return visitor->until([&] { return right(arm->ticks - 1); });
  }
  // A later tick of the arm that gives a force.
  bool forceWithin(std::int64_t ticks) {
    const std::int64_t begin = arm->ticks;
    EXPECT_TRUE(eventually([&] { return arm->ticks > begin + ticks; }));
    for (std::int64_t tick = begin + 1; tick <= begin + ticks; ++tick) {
      if (!arm.force(tick).isZero()) return true;
    }
    return false;
  }
  char stateOfServer() const {
    std::ifstream status("/proc/" + std::to_string(server->id()) + "/stat");
    std::string text((std::istreambuf_iterator<char>(status)), {});
    const std::size_t end = text.rfind(')');
    return end == std::string::npos ? '?' : text[end + 2];
  }
  // The isolation host is the server's only child.
  pid_t host() const {
    for (const auto& process : std::filesystem::directory_iterator("/proc")) {
      std::ifstream status(process.path() / "status");
      for (std::string line; std::getline(status, line);) {
        if (line == "PPid:\t" + std::to_string(server->id())) return std::stoi(process.path().filename());
      }
    }
    return 0;
  }
};

class EndingSignals : public Signals, public testing::WithParamInterface<int> {};

TEST_P(EndingSignals, LeaveNoForce) {
  serve(kInProcess, kMock);
  server->signal(GetParam());
  EXPECT_EQ(server->end(), 0) << server->log();
  EXPECT_TRUE(arm.left().isZero());
  EXPECT_EQ(arm->closed, 1) << "in order";
}
INSTANTIATE_TEST_SUITE_P(By, EndingSignals,
                         testing::Values(SIGHUP, SIGQUIT, SIGUSR1, SIGVTALRM, SIGRTMIN + 3),
                         [](const auto& instance) { return "Signal" + std::to_string(instance.param); });

TEST_F(Signals, OfPipesLimitsAndTerminalsAreIgnored) {
  serve(kInProcess, kMock);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGTTIN, SIGTTOU, SIGCHLD, SIGWINCH, SIGURG, SIGCONT}) {
    server->signal(signal);
    visitor->client().runFor(20ms);
    EXPECT_TRUE(forceRests()) << signal << server->log();
  }
  endInOrder();
}

TEST_F(Signals, OfTheTerminalStopTheForcesBeforeTheProcess) {
  serve(kInProcess, kMock);
  server->signal(SIGTSTP);
  ASSERT_TRUE(eventually([&] { return stateOfServer() == 'T'; })) << server->log();
  EXPECT_TRUE(arm.left().isZero());
  server->signal(SIGCONT);
  EXPECT_TRUE(visitor->until([&] { return visitor->client().latest().guard.stopped; })) << server->log();
  EXPECT_FALSE(forceWithin(50)) << "stopped until a re-arm";
  visitor->client().rearmForces();
  EXPECT_TRUE(visitor->until([&] {
    if (visitor->latched()) visitor->client().rearmForces();
    return right(arm->ticks - 1);
  })) << server->log();
  endInOrder();
}

TEST_F(Signals, OfLogindBeforeASleepLeaveNoForce) {
  const test::PrivateBus bus;
  if (!bus.runs()) GTEST_SKIP() << "dbus-daemon is missing (packages.txt, section test)";
  test::ScriptedLogind logind;
  serve(kInProcess, kMock);
  ASSERT_TRUE(logind.waitHeld({"block", "delay"})) << server->log();
  logind.announceSleep(true);
  ASSERT_TRUE(logind.waitHeld({})) << server->log();
  EXPECT_TRUE(arm.left().isZero()) << "before the machine sleeps";
  logind.announceSleep(false);
  EXPECT_TRUE(visitor->until([&] { return visitor->client().latest().guard.stopped; })) << server->log();
  EXPECT_FALSE(forceWithin(50)) << "stopped until a re-arm";
  visitor->client().rearmForces();
  EXPECT_TRUE(visitor->until([&] {
    if (visitor->latched()) visitor->client().rearmForces();
    return right(arm->ticks - 1);
  })) << server->log();
  ASSERT_TRUE(logind.waitHeld({"block", "delay"})) << server->log();
  endInOrder();
}

TEST_F(Signals, ToTheIsolationHostChangeNothingAndItOutlivesTheServer) {
  serve({"--device", "openhaptics"}, kMock);
  const pid_t process = host();
  ASSERT_GT(process, 0);
  EXPECT_NE(getsid(process), getsid(server->id())) << "a closed terminal does not end it";
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGPIPE}) {
    kill(process, signal);
    visitor->client().runFor(20ms);
    EXPECT_TRUE(forceRests()) << signal << server->log();
  }
  // A server that is stopped by a debugger or SIGSTOP renews no force: three ticks, and the one that had
  // begun.
  server->signal(SIGSTOP);
  ASSERT_TRUE(eventually([&] { return stateOfServer() == 'T'; }));
  const std::int64_t stopped = arm->ticks;
  ASSERT_TRUE(eventually([&] { return arm->ticks > stopped + 60; }));
  for (std::int64_t tick = stopped + 4; tick < stopped + 60; ++tick)
    EXPECT_TRUE(arm.force(tick).isZero()) << tick;
  server->signal(SIGKILL);
  EXPECT_NE(server->end(), -1);
  EXPECT_TRUE(eventually([&] { return arm->closed == 1; }));
  EXPECT_TRUE(arm.left().isZero());
}

// The server's output is a pipe that this test reads, or not.
class UnreadLog : public Signals {
 protected:
  void SetUp() override {
    ASSERT_EQ(pipe2(pipe_.data(), O_CLOEXEC), 0);
    std::vector<std::string> arguments = kInProcess;
    arguments.insert(arguments.end(), {"--enable-forces", "--http", "off"});
    server.emplace(work, arguments,
                   std::vector<std::string>{kMock.front(), "HAPTICD_MOCK_ARM=" + work.file("arm")}, pipe_[1]);
    close(pipe_[1]);
    const std::string before = "listening on ";
    std::string text;
    while (text.find("(TCP and UDP)") == std::string::npos) {
      std::array<char, 4096> more;
      const ssize_t size = read(pipe_[0], more.data(), more.size());
      ASSERT_GT(size, 0) << text;
      text.append(more.data(), static_cast<std::size_t>(size));
    }
    const std::size_t begin = text.find(before) + before.size();
    address_ = text.substr(begin, text.find(' ', begin) - begin);
    visit(address_);
    ASSERT_TRUE(forceRests());
  }
  void TearDown() override {
    if (pipe_[0] >= 0) close(pipe_[0]);
  }
  // More lines than a pipe holds.
  void chatter() {
    const std::size_t colon = address_.find(':');
    const auto endpoint = net::Endpoint::parse(
        address_.substr(0, colon), static_cast<std::uint16_t>(std::stoi(address_.substr(colon + 1))));
    test::ScriptedPeer peer(endpoint);
    EXPECT_TRUE(peer.untilConnected());
    for (int i = 0; i < 100; ++i) {
      peer.send(wire::Text{.severity = 2, .level = 0, .text = std::string(1000, 'x')});
      if (i % 20 == 0) visitor->client().runFor(100ms);  // lines are throttled by the second
    }
    for (int i = 0; i < 100; ++i) {
      test::ScriptedPeer other(endpoint);
      EXPECT_TRUE(other.untilConnected());
      visitor->client().poll(0ms);
    }
  }
  void expectStopAndEnd() {
    EXPECT_TRUE(forceRests());
    Client panel("Phantom@tcp://" + address_, {.connectTimeout = 60s, .reconnect = false});
    panel.stopForces();
    panel.flushAll();
    EXPECT_TRUE(eventually([&] { return arm.left().isZero(); }));
    server->signal(SIGTERM);
    EXPECT_EQ(server->end(), 0);
    EXPECT_TRUE(arm.left().isZero());
    EXPECT_EQ(arm->closed, 1);
  }

  std::array<int, 2> pipe_{-1, -1};
  std::string address_;
};

TEST_F(UnreadLog, HoldsNobodyUp) {
  fcntl(pipe_[0], F_SETPIPE_SZ, 4096);
  chatter();
  expectStopAndEnd();
}

TEST_F(UnreadLog, WhoseReaderIsGoneEndsNothing) {
  close(std::exchange(pipe_[0], -1));
  chatter();
  expectStopAndEnd();
}

}  // namespace
}  // namespace hapticd::whole_server
