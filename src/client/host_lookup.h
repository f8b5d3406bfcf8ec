// A server may come back under another address, which only its name tells.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

namespace hapticd::client {

/// The address of a host by its name. Thread: one.
class HostLookup {
 public:
  /// Asks the system, which may block. Throws net::Error for an unknown host.
  explicit HostLookup(std::string host);

  /// The last address that is known, host byte order.
  std::uint32_t address();
  /// Asks again, in a thread of its own, because the system may take many seconds for the answer; neither
  /// address() nor the destructor waits for it. Without an answer the last address stays.
  void askAgain();

 private:
  struct Question {
    std::atomic<bool> answered{false};
    std::uint32_t address = 0;  // 0: the system knows none
  };
  const std::string host_;
  bool isNumber_;
  std::uint32_t address_;
  std::shared_ptr<Question> question_;  // that has been asked, and was not yet read
};

}  // namespace hapticd::client
