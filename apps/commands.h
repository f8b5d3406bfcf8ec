// The subcommands of hapticd: one file each, registered here.
#pragma once

#include <CLI/CLI.hpp>

namespace hapticd::apps {

/// What the process returns; a subcommand's callback sets it.
inline int exitCode = 0;

void addServe(CLI::App& app);
void addTouch(CLI::App& app);
void addRender(CLI::App& app);
void addDoctor(CLI::App& app);
void addDevices(CLI::App& app);

}  // namespace hapticd::apps
