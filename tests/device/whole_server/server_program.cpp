// hapticd with the subcommands that the tests of a whole server start: serve and device-host.
#include <cstdio>
#include <exception>

#include "commands.h"

int main(int argc, char** argv) {
  using namespace hapticd::apps;
  CLI::App app{"hapticd"};
  app.require_subcommand(1);
  addServe(app);
  addDeviceHost(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "hapticd: %s\n", error.what());
    return 1;
  }
  return exitCode;
}
