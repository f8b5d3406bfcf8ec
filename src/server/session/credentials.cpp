#include "server/session/credentials.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <sstream>
#include <system_error>

#include "base/world.h"
#include "wire/messages/extension.h"

namespace hapticd::server {
namespace {

constexpr std::size_t kShortest = wire::Identify::kShortestToken;
constexpr std::size_t kLongest = wire::Identify::kLongestToken;
constexpr std::size_t kMostSources = 4096;
constexpr std::uint32_t kRoot = 0;

bool contains(const std::vector<std::uint32_t>& users, std::uint32_t user) {
  return std::find(users.begin(), users.end(), user) != users.end();
}

// The same work whatever the texts are.
bool equalInConstantTime(std::string_view a, std::string_view b) {
  std::array<char, kLongest> left{};
  std::array<char, kLongest> right{};
  std::copy_n(a.begin(), std::min(a.size(), kLongest), left.begin());
  std::copy_n(b.begin(), std::min(b.size(), kLongest), right.begin());
  volatile unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < kLongest; ++i)
    difference = difference | static_cast<unsigned char>(left[i] ^ right[i]);
  return difference == 0;
}

std::string readPrivate(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::is_directory(file, error)) throw ConfigError("tokens: '" + file + "' is a directory; name a file");
  const fs::perms mode = fs::status(file, error).permissions();
  if (!error && (mode & (fs::perms::group_all | fs::perms::others_all)) != fs::perms::none) {
    throw ConfigError("tokens: others than its owner may use '" + file + "': chmod 0600 " + file);
  }
  try {
    const std::vector<std::byte> bytes = base::world().files.read(file);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  } catch (const std::system_error& failure) {
    throw ConfigError("tokens: cannot read '" + file + "': " + failure.code().message());
  }
}

}  // namespace

Credentials::Credentials(const ServerConfig& config, std::uint32_t serverUser)
    : ownerUsers_(usersNamed(config.ownerUsers, "owner_users")),
      operatorUsers_(usersNamed(config.operatorUsers, "operator_users")),
      trusted_(parseSubnets(config.trustedNetworks)),
      serverUser_(serverUser) {
  if (config.tokens.empty()) return;
  std::istringstream lines(readPrivate(config.tokens));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line);
    std::string role;
    std::string token;
    std::string more;
    if (!(words >> role) || role.front() == '#') continue;
    words >> token >> more;
    if (more.starts_with('#')) more.clear();  // inside a token it is a character of it
    const std::string place = config.tokens + ":" + std::to_string(number) + ": ";
    const auto named = [&](ClientRole each) { return role == nameOf(each); };
    const bool known =
        named(ClientRole::observer) || named(ClientRole::operating) || named(ClientRole::owner);
    if (!known || token.empty() || !more.empty()) {
      throw ConfigError(place + "expected 'owner TOKEN', 'operator TOKEN' or 'observer TOKEN'");
    }
    if (token.size() < kShortest || token.size() > kLongest) {
      throw ConfigError(place + "a token must have 16 to 128 characters, got " +
                        std::to_string(token.size()) + "; 'openssl rand -hex 32' makes one");
    }
    if (std::any_of(tokens_.begin(), tokens_.end(), [&](const Token& each) { return each.text == token; }))
      throw ConfigError(place + "the same token as on a line before; each role needs one of its own");
    tokens_.push_back({token, named(ClientRole::owner)       ? ClientRole::owner
                              : named(ClientRole::operating) ? ClientRole::operating
                                                             : ClientRole::observer});
  }
  if (tokens_.empty()) throw ConfigError("tokens: '" + config.tokens + "' names no token");
}

Identity Credentials::identityOf(std::uint32_t address, std::optional<std::uint32_t> user) const {
  if (user) {
    if (*user == kRoot || *user == serverUser_ || contains(ownerUsers_, *user))
      return {ClientRole::owner, true};
    if (contains(operatorUsers_, *user)) return {ClientRole::operating, true};
  } else if (std::any_of(trusted_.begin(), trusted_.end(), [&](const Subnet& s) { return s.has(address); })) {
    return {ClientRole::owner, false};
  }
  return {configured() ? ClientRole::observer : ClientRole::owner, false};
}

std::optional<Identity> Credentials::check(std::string_view token, const std::string& source, base::Nanos now,
                                           std::string& error) {
  std::erase_if(failures_, [&](const auto& entry) { return now - entry.second.since > kWindow; });
  const auto known = failures_.find(source);
  if (known != failures_.end() && known->second.count >= kMostFailures) {
    error = "too many wrong tokens: try again in a minute";
    return std::nullopt;
  }
  const Token* found = nullptr;
  for (const Token& each : tokens_) {
    if (equalInConstantTime(each.text, token)) found = &each;
  }
  if (found != nullptr) return Identity{found->role, true};
  // A client with very many addresses must not keep others from presenting a token.
  if (known == failures_.end() && failures_.size() >= kMostSources) {
    const auto earlier = [](const auto& a, const auto& b) { return a.second.since < b.second.since; };
    failures_.erase(std::min_element(failures_.begin(), failures_.end(), earlier));
  }
  Failures& failures = known != failures_.end() ? known->second : failures_[source];
  if (failures.count++ == 0) failures.since = now;
  error = tokens_.empty() ? "this server has no tokens" : "wrong token";
  return std::nullopt;
}

bool Credentials::hasOperators() const noexcept {
  const auto mayRearm = [](const Token& token) { return token.role != ClientRole::observer; };
  return !ownerUsers_.empty() || !operatorUsers_.empty() ||
         std::any_of(tokens_.begin(), tokens_.end(), mayRearm);
}

}  // namespace hapticd::server
