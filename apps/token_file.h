// Tokens of clients, in files that nobody else may read.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace hapticd::apps {

/// The first word of the file. Throws std::runtime_error when others may use the file, or it holds no token.
std::string readToken(const std::string& file);

/// --token-file of a command that opens the device `server`, NAME@host.
CLI::Option* addTokenFile(CLI::App& command, std::string& file);
/// The token for that device; empty for no file. Throws std::runtime_error as readToken(), and when the token
/// would cross a network in clear text.
std::string tokenFor(const std::string& server, const std::string& file);

}  // namespace hapticd::apps
