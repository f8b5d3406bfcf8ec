// Tokens of clients, in files that nobody else may read.
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "wire/messages/extension.h"

namespace hapticd::apps {

/// The first word of the file. Throws std::runtime_error when others may use the file, or it holds no token.
inline std::string readToken(const std::string& file) {
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

}  // namespace hapticd::apps
