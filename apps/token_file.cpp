#include "token_file.h"

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "client/server_address.h"
#include "commands.h"
#include "net/endpoint.h"
#include "wire/messages/extension.h"

namespace hapticd::apps {

std::string readToken(const std::string& file) {
  namespace fs = std::filesystem;
  const fs::perms mode = fs::status(file).permissions();
  if ((mode & (fs::perms::group_all | fs::perms::others_all)) != fs::perms::none)
    throw std::runtime_error("others may use '" + file + "': chmod 0600 " + file);
  std::ifstream in(file);
  std::string token;
  if (!(in >> token)) throw std::runtime_error("cannot read a token from '" + file + "'");
  if (token.size() < wire::Identify::kShortestToken || token.size() > wire::Identify::kLongestToken)
    throw std::runtime_error("the token in '" + file + "' has " + std::to_string(token.size()) +
                             " characters; a token has 16 to 128");
  return token;
}

CLI::Option* addTokenFile(CLI::App& command, std::string& file) {
  return command
      .add_option("--token-file", file,
                  "File with your token, mode 0600; only for a server on this machine, or through a tunnel")
      ->check(existingFile());
}

std::string tokenFor(const std::string& server, const std::string& file) {
  if (file.empty()) return "";
  const client::ServerAddress address = client::parseDevice(server).server;
  const bool here = !address.socket.empty() ||
                    net::isLoopback(net::Endpoint{net::resolve(address.host), address.port}.address);
  if (!here)
    throw std::runtime_error("the token would cross the network to " + address.text() +
                             " unencrypted: leave --token-file to 'hapticd tunnel', and open "
                             "NAME@tcp://127.0.0.1:PORT of that tunnel");
  return readToken(file);
}

}  // namespace hapticd::apps
