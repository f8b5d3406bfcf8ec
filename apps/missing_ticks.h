// Tells a person that rows are missing in a stream of ticks.
#pragma once

#include <cstdint>
#include <cstdio>
#include <optional>

namespace hapticd::apps {

/// Counts the ticks between others that did not arrive.
class MissingTicks {
 public:
  void add(std::uint64_t tick) noexcept {
    if (last_ && tick > *last_ + 1) missing_ += tick - *last_ - 1;
    last_ = tick;
  }
  /// After a new connection: the server may count anew.
  void restart() noexcept { last_.reset(); }
  /// Prints the number, unless it is 0 or ticks are left out on purpose at this rate.
  void print(const char* program, double rate_Hz, double servoRate_Hz) const {
    if (missing_ == 0 || rate_Hz < servoRate_Hz) return;
    std::fprintf(stderr,
                 "%s: %llu ticks between the first and the last are missing: this program or the network was "
                 "too slow for them. The server itself loses none: hapticd record --server\n",
                 program, static_cast<unsigned long long>(missing_));
  }

 private:
  std::optional<std::uint64_t> last_;
  std::uint64_t missing_ = 0;
};

}  // namespace hapticd::apps
