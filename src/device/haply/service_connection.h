// One WebSocket connection to the service. Each call returns or throws within a time limit.
#pragma once

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

namespace hapticd::device::haply {

/// Why there is no answer.
class ConnectionError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// For one thread. Every call may block up to its time limit and throws ConnectionError.
class ServiceConnection {
 public:
  ServiceConnection(const std::string& host, const std::string& port, std::chrono::milliseconds most);
  ~ServiceConnection();
  ServiceConnection(const ServiceConnection&) = delete;
  ServiceConnection& operator=(const ServiceConnection&) = delete;

  void send(std::string_view text, std::chrono::milliseconds most);
  /// The next message; valid until the next call.
  std::string_view receive(std::chrono::milliseconds most);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::device::haply
