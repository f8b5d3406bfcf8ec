// hapticd: a haptics server that speaks VRPN, and the tools around it.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "commands.h"
#include "version.h"

namespace {

// The number of letters to change, leave out or add.
std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t cost = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, cost});
    }
  }
  return row[b.size()];
}

std::string nearestCommand(const CLI::App& app, const std::string& typed) {
  std::string nearest;
  std::size_t least = 4;  // farther names are no help
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* each) { return !each->get_group().empty(); })) {
    const std::size_t distance = editDistance(typed, command->get_name());
    if (distance >= least) continue;
    least = distance;
    nearest = command->get_name();
  }
  return nearest;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace hapticd::apps;
  CLI::App app{
      "hapticd: a haptics server that speaks VRPN.\n"
      "One process owns a haptic device, takes a scene from any VRPN client, renders forces at 1 kHz\n"
      "and reports pose, contact and force to all clients.\n\n"
      "A first touch, without hardware:\n"
      "  hapticd demo\n"
      "The same in two terminals, with a mesh of your own:\n"
      "  hapticd serve\n"
      "  hapticd touch bunny.obj --server Phantom@localhost"};
  app.name("hapticd");
  app.set_version_flag("--version", versionText());
  app.require_subcommand(1);
  addDemo(app);
  addServe(app);
  addTouch(app);
  addWatch(app);
  addStop(app);
  addRecord(app);
  addExport(app);
  addInfo(app);
  addRender(app);
  addReplay(app);
  addDoctor(app);
  addDevices(app);
  addSelfTest(app);
  addBench(app);
  addManual(app);
  addDeviceHost(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::RequiredError& error) {
    const std::vector<std::string> rest = app.remaining();
    if (app.get_subcommands().empty() && !rest.empty()) {
      const std::string nearest = nearestCommand(app, rest[0]);
      std::fprintf(stderr, "hapticd: unknown command '%s';%s 'hapticd --help' lists the commands\n",
                   rest[0].c_str(), nearest.empty() ? "" : (" did you mean '" + nearest + "'?").c_str());
      return 2;
    }
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "hapticd: %s\n", error.what());
    return 1;
  }
  return exitCode;
}
