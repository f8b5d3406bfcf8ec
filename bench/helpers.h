// What has to run in other processes: yardsticks of the network. The suite starts them from its own binary.
#pragma once

#include <string>
#include <vector>

#include "bench/server_process.h"

namespace hapticd::bench {

/// Runs one: "pipeline PORT", "plain PORT", "sink PORT BYTES", "blaster CLIENTS",
/// "default-blaster CLIENTS", "stock CLIENTS", "device-host". Returns the exit code.
int runHelper(const std::vector<std::string>& arguments);

/// Bytes of one message of the raw pipelines; the first eight are the time it is about, CLOCK_MONOTONIC in
/// ns.
inline constexpr std::size_t kPipelineBytes = 32;

/// Starts one of them.
class Helper {
 public:
  explicit Helper(std::vector<std::string> arguments);
  ChildProcess& process() noexcept { return process_; }
  /// The port that a blaster listens on.
  std::uint16_t port() const;

 private:
  WorkDirectory work_;
  ChildProcess process_;
};

}  // namespace hapticd::bench
