#include "net/local_socket.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

class LocalSocket : public testing::Test {
 protected:
  ~LocalSocket() override { std::filesystem::remove_all(folder_); }

  static std::filesystem::path makeFolder() {
    std::string name = std::filesystem::temp_directory_path() / "hapticd-local-XXXXXX";
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp");
    return name;
  }

  const std::filesystem::path folder_ = makeFolder();
  const std::filesystem::path path_ = folder_ / "server.sock";
  Loop loop_;
};

TEST_F(LocalSocket, AcceptsAndNamesTheUser) {
  std::vector<Connection> accepted;
  const LocalListener listener(loop_, path_, [&](Connection c) { accepted.push_back(std::move(c)); });
  const Connection client = connectLocal(loop_, path_);
  ASSERT_TRUE(pumpUntil(loop_, [&] { return accepted.size() == 1; }));
  EXPECT_EQ(accepted[0].peerUser(), geteuid());
}

TEST_F(LocalSocket, ThePathIsFreeAfterDestructionAlsoWithinItsCallback) {
  std::unique_ptr<LocalListener> listener;
  listener = std::make_unique<LocalListener>(loop_, path_, [&](Connection) { listener.reset(); });
  const Connection first = connectLocal(loop_, path_);
  const Connection second = connectLocal(loop_, path_);
  ASSERT_TRUE(pumpUntil(loop_, [&] { return listener == nullptr; }));
  EXPECT_FALSE(std::filesystem::exists(path_));
  const LocalListener again(loop_, path_, [](Connection) {});
}

TEST_F(LocalSocket, AFileAtItsPathStays) {
  std::ofstream(path_) << "notes";
  EXPECT_THROW(LocalListener(loop_, path_, [](Connection) {}), Error);
  EXPECT_EQ(std::filesystem::file_size(path_), 5U);
}

// As after somebody has tidied up, and started another server.
TEST_F(LocalSocket, WhatTookItsPathStaysWhenItEnds) {
  auto first = std::make_unique<LocalListener>(loop_, path_, [](Connection) {});
  std::filesystem::remove(path_);
  std::vector<Connection> accepted;
  const LocalListener second(loop_, path_, [&](Connection c) { accepted.push_back(std::move(c)); });
  first.reset();
  const Connection client = connectLocal(loop_, path_);
  EXPECT_TRUE(pumpUntil(loop_, [&] { return accepted.size() == 1; }));
}

// A server of a desktop session, and a user from su, cron or a container, where the variable is not set.
TEST_F(LocalSocket, IsFoundInTheFolderOfASessionThatTheEnvironmentDoesNotName) {
  const Endpoint listening{kLoopbackAddress, 1};
  const std::filesystem::path sessions = "/run/user";
  const std::filesystem::path session = sessions / std::to_string(geteuid());
  std::error_code error;
  const bool madeBoth = std::filesystem::create_directory(sessions, error);
  const bool made = std::filesystem::create_directory(session, error);
  if (error) GTEST_SKIP() << session << ": " << error.message();
  const char* const before = std::getenv("XDG_RUNTIME_DIR");
  const std::string runtime = before != nullptr ? before : "";
  ::setenv("XDG_RUNTIME_DIR", session.c_str(), 1);
  {
    const LocalListener listener(loop_, defaultSocketPath(listening), [](Connection) {});
    ::unsetenv("XDG_RUNTIME_DIR");
    EXPECT_EQ(findServerSocket(listening), listener.path());
  }
  if (before != nullptr) ::setenv("XDG_RUNTIME_DIR", runtime.c_str(), 1);
  if (made) std::filesystem::remove_all(madeBoth ? sessions : session);
}

// Of a server that was killed, in a session, for example; the new one runs as a service.
TEST_F(LocalSocket, OneThatNobodyListensAtIsNotFound) {
  const Endpoint listening{kLoopbackAddress, 1};
  const char* const before = std::getenv("XDG_RUNTIME_DIR");
  const std::string runtime = before != nullptr ? before : "";
  ::setenv("XDG_RUNTIME_DIR", folder_.c_str(), 1);
  const std::filesystem::path path = defaultSocketPath(listening);
  {
    const LocalListener listener(loop_, path, [](Connection) {});
    EXPECT_EQ(findServerSocket(listening), path);
    std::filesystem::rename(path, path.string() + "x");
  }
  std::filesystem::rename(path.string() + "x", path);
  EXPECT_NE(findServerSocket(listening), path);
  {
    const LocalListener listener(loop_, path, [](Connection) {});
    EXPECT_EQ(findServerSocket(listening), path) << "a new server takes its place";
  }
  before != nullptr ? ::setenv("XDG_RUNTIME_DIR", runtime.c_str(), 1) : ::unsetenv("XDG_RUNTIME_DIR");
}

#ifndef HAPTICD_SANITIZED
// Another listener takes each descriptor that becomes free.
TEST_F(LocalSocket, OutOfDescriptorsItTellsAndAcceptsLater) {
  std::vector<std::string> errors;
  loop_.setErrorHandler([&](std::string_view text) { errors.emplace_back(text); });
  std::vector<Connection> accepted;
  const LocalListener listener(loop_, path_, [&](Connection c) { accepted.push_back(std::move(c)); });
  Server server(loop_);
  const Connection client = connectLocal(loop_, path_);
  const RawSocket peer = RawSocket::connected(server.listener.local());
  {
    const NoDescriptors none;
    loop_.runFor(std::chrono::milliseconds(500));
  }
  EXPECT_TRUE(accepted.empty());
  const std::string text = "cannot accept a connection on " + path_.string() + ": Too many open files";
  EXPECT_EQ(std::count(errors.begin(), errors.end(), text), 1);
  loop_.runFor(std::chrono::milliseconds(500));
  EXPECT_EQ(accepted.size(), 1U);
  EXPECT_EQ(server.sessions.size(), 1U);
}
#endif

}  // namespace
}  // namespace hapticd::net
