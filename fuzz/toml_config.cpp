// Configurations: each is read, or refused with a text that names the file; what we write, we read.
#include <string>

#include "fuzz/targets.h"
#include "server/config/config.h"

namespace hapticd::fuzz {

void toml_config(Input input) {
  try {
    const server::ServerConfig config = server::parseConfig(std::string(textOf(input)), "server.toml");
    require(server::parseConfig(server::toToml(config), "again.toml") == config,
            "a written configuration is read the same");
  } catch (const server::ConfigError& error) {
    require(std::string_view(error.what()).find("server.toml") != std::string_view::npos,
            "an error names the file");
  }
}

}  // namespace hapticd::fuzz
