// Tokens and user ids: which role a client has.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "server/config/config.h"
#include "server/session/identity.h"

namespace hapticd::server {

/// Net thread. No text of this class contains a token.
class Credentials {
 public:
  static constexpr int kMostFailures = 10;
  static constexpr base::Nanos kWindow = 60'000'000'000;

  /// Reads the file of tokens; throws ConfigError when others may read it or a line is malformed.
  /// `serverUser` is the user of this process.
  Credentials(const ServerConfig& config, std::uint32_t serverUser);

  /// The identity of a connection before it presents a token. `user`: for a Unix socket, the peer's.
  Identity identityOf(std::uint32_t address, std::optional<std::uint32_t> user) const;
  /// The identity that a token gives, compared in constant time. Nothing, with the reason, for a wrong token,
  /// and for any token from a source that has presented kMostFailures wrong ones within kWindow.
  std::optional<Identity> check(std::string_view token, const std::string& source, base::Nanos now,
                                std::string& error);
  /// Whether a token or a user id makes somebody an operator or owner, besides root and the server's user.
  bool hasOperators() const noexcept;
  /// Whether clients are observers unless they prove more.
  bool configured() const noexcept {
    return !tokens_.empty() || !ownerUsers_.empty() || !operatorUsers_.empty();
  }

 private:
  struct Token {
    std::string text;
    ClientRole role;
  };
  struct Failures {
    base::Nanos since = 0;
    int count = 0;
  };

  std::vector<Token> tokens_;
  std::vector<std::uint32_t> ownerUsers_;
  std::vector<std::uint32_t> operatorUsers_;
  std::vector<Subnet> trusted_;
  std::uint32_t serverUser_;
  std::map<std::string, Failures> failures_;
};

}  // namespace hapticd::server
