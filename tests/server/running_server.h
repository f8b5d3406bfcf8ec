// A whole server in its own thread, on its own port.
#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <thread>
#include <utility>

#include "server/server.h"

namespace hapticd::test {

class RunningServer {
 public:
  explicit RunningServer(const server::ServerConfig& config = anyPort(),
                         std::unique_ptr<server::ServerFinder> finder = nullptr)
      : server_(config) {
    if (finder) server_.searchNetworkBy(std::move(finder));
    // Creates the log while there is one thread: the thread sanitizer does not see the locks in its library.
    spdlog::default_logger();
    thread_ = std::thread([this] { server_.run(); });
  }
  ~RunningServer() { stop(); }

  static server::ServerConfig anyPort() {
    server::ServerConfig config;
    config.port = 0;
    config.allowNoRealtime = true;
    config.http = server::kHttpOff;
    config.socket = server::kSocketOff;
    // A stalled machine latches faults: do not write black boxes to the user's home.
    config.devices.front().blackBoxKeep = 0;
    return config;
  }
  void stop() {
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }
  net::Endpoint address() const { return server_.address(); }
  server::Server& server() { return server_; }

 private:
  server::Server server_;
  std::thread thread_;
};

}  // namespace hapticd::test
