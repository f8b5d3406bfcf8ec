// One request to the web port, of a page, a scraper or somebody hostile.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "net/connection.h"
#include "sim/sim_client.h"

namespace hapticd::sim {

class Visit {
 public:
  enum class Manner {
    reads,     ///< as a browser does
    dribbles,  ///< sends its request in small pieces
    stalls,    ///< sends half of its request, or does not read the answer
    leaves,    ///< resets the connection at some time
  };
  static constexpr int kManners = 4;

  struct Answer {
    int status = 0;
    std::string body;
  };

  Visit(Clients& all, std::string target, Manner manner, std::uint64_t seed,
        std::function<void(const Answer&)> onAnswer);

  const std::string& target() const { return target_; }
  Nanos asked() const { return asked_; }
  /// An answer is due: it does what it should, and none has come.
  bool waits() const { return !over_; }

 private:
  void send(std::size_t from);
  void receive(std::span<const std::byte> bytes);

  Clients& all_;
  const std::string target_;
  const Manner manner_;
  Dice dice_;
  const std::function<void(const Answer&)> onAnswer_;
  const Nanos asked_;
  std::string request_;
  std::string input_;
  bool over_;
  net::Subscription timer_;
  net::Connection connection_;
};

}  // namespace hapticd::sim
