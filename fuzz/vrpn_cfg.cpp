// Configurations of stock servers: each is read, or refused with a text that names the file.
#include <string>
#include <vector>

#include "fuzz/targets.h"
#include "server/config/vrpn_cfg.h"

namespace hapticd::fuzz {

void vrpn_cfg(Input input) {
  try {
    std::vector<std::string> warnings;
    const server::ServerConfig config =
        server::parseVrpnCfg(std::string(textOf(input)), "vrpn.cfg", warnings);
    for (const server::DeviceConfig& device : config.devices)
      require(!device.names.empty(), "devices have names");
  } catch (const server::ConfigError& error) {
    require(std::string_view(error.what()).find("vrpn.cfg") != std::string_view::npos,
            "an error names the file");
  }
}

}  // namespace hapticd::fuzz
