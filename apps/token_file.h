// Tokens of clients, in files that nobody else may read.
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace hapticd::apps {

/// The first word of the file. Throws std::runtime_error when others may use the file, or it is empty.
inline std::string readToken(const std::string& file) {
  namespace fs = std::filesystem;
  const fs::perms mode = fs::status(file).permissions();
  if ((mode & (fs::perms::group_all | fs::perms::others_all)) != fs::perms::none)
    throw std::runtime_error("others may use '" + file + "': chmod 0600 " + file);
  std::ifstream in(file);
  std::string token;
  if (!(in >> token)) throw std::runtime_error("cannot read a token from '" + file + "'");
  return token;
}

}  // namespace hapticd::apps
