// hapticd render: renders a mesh along a recorded hand, or re-renders a recording; offline and deterministic.
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "commands.h"
#include "render_mesh.h"
#include "render_recording.h"

namespace hapticd::apps {
namespace {

struct RenderCommandOptions {
  MeshRenderOptions mesh;
  std::string session;
  std::string report;
  bool force = false;
};

void addMeshOptions(CLI::App& command, MeshRenderOptions& options) {
  command.add_option("--mesh", options.mesh, "OBJ, STL, PLY or glTF file")->check(existingFile());
  command.add_option("--mesh-unit", options.meshUnit, "Length unit of the file")
      ->check(CLI::IsMember({"mm", "m"}))
      ->capture_default_str();
  command
      .add_option("--size-mm", options.size_mm,
                  "Scale the mesh to this largest extent and centre it [unchanged]")
      ->check(within(1e-6, 1e6));
  command
      .add_option("--hand", options.hand,
                  "CSV: t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons] in device metres, or any CSV that hapticd "
                  "wrote; or a "
                  ".traj file")
      ->check(existingFile());
  command
      .add_option("--compare", options.compare,
                  ".traj file with measured forces: print how far the rendered ones are from them")
      ->check(existingFile());
  command
      .add_option("--faces", options.faces,
                  "Sides that can be touched; seen from the front, corners run counter-clockwise")
      ->check(CLI::IsMember({"front", "back", "both"}))
      ->capture_default_str();
  command.add_flag("--timing", options.timing,
                   "Fill the column compute_ns (the only one that differs from run to run)");
}

void addTrajectoryOptions(CLI::App& command, device::TrajectoryFormat& format) {
  const auto columns = [&format](const std::string& names) {
    try {
      format.columns = device::TrajectoryColumns::parse(names);
    } catch (const std::invalid_argument& error) {
      throw CLI::ValidationError("--traj-columns", error.what());
    }
  };
  const auto choice = [&](const char* name, const char* text, std::vector<std::string> values, auto&& use) {
    command.add_option_function<std::string>(name, use, text)
        ->check(CLI::IsMember(values))
        ->default_str(values.front());
  };
  command
      .add_option_function<std::string>(
          "--traj-columns", columns,
          "Columns of .traj files in order: t, x, y, z, fx, fy, fz, or - to skip one")
      ->default_str("t,x,y,z[,fx,fy,fz]");
  choice("--traj-unit", "Length unit of .traj files", {"mm", "m"},
         [&format](const std::string& unit) { format.unit_m = unit == "m" ? 1 : 1e-3; });
  choice("--traj-time-unit", "Time unit of .traj files", {"s", "ms"},
         [&format](const std::string& unit) { format.unit_s = unit == "ms" ? 1e-3 : 1; });
  choice("--traj-force", "What the forces of .traj files act on", {"probe", "surface"},
         [&format](const std::string& on) { format.forceOnSurface = on == "surface"; });
}

void addSurfaceOptions(CLI::App& command, MeshRenderOptions& options) {
  const auto add = [&](const char* name, double& value, const char* text, double most) {
    command.add_option(name, value, text)->check(within(0, most))->capture_default_str();
  };
  add("--stiffness-N-per-m,--stiffness", options.stiffness_N_per_m, "Stiffness K", 1e6);
  add("--damping-Ns-per-m,--damping", options.damping_Ns_per_m, "Damping B along the normal", 1e6);
  add("--static-friction", options.staticFriction, "Coulomb coefficient while sticking", 1e6);
  add("--dynamic-friction", options.dynamicFriction,
      "Coulomb coefficient while sliding, at most the static one; given alone with --session, it raises a "
      "lower static one, too",
      1e6);
  add("--tool-radius-mm,--tool-radius", options.toolRadius_mm, "Radius of the tip; 0 is a point", 50);
  command.add_flag("--raw", options.raw,
                   "Leave out the guard, the passivity clamp and the limits of surfaces");
}

// RenderCommandOptions on the command line are changes; all else stays as recorded.
record::RerenderChanges changesOf(const CLI::App& command, const MeshRenderOptions& options) {
  const auto given = [&](const char* name, double value) {
    return command.count(name) > 0 ? std::optional<double>(value) : std::nullopt;
  };
  record::RerenderChanges changes;
  changes.stiffness_N_per_m = given("--stiffness-N-per-m", options.stiffness_N_per_m);
  changes.damping_Ns_per_m = given("--damping-Ns-per-m", options.damping_Ns_per_m);
  changes.staticFriction = given("--static-friction", options.staticFriction);
  changes.dynamicFriction = given("--dynamic-friction", options.dynamicFriction);
  changes.toolRadius_m = given("--tool-radius-mm", options.toolRadius_mm * 1e-3);
  changes.raw = options.raw;
  return changes;
}

// Mesh, hand and reference fit together.
void checkTrajectories(const CLI::App& command, const MeshRenderOptions& options) {
  const bool handIsTrajectory = device::Trajectory::isNameOf(options.hand);
  if (!options.compare.empty() && !device::Trajectory::isNameOf(options.compare))
    throw std::runtime_error("--compare needs a .traj file, got " + options.compare);
  if (handIsTrajectory && options.size_mm > 0)
    throw std::runtime_error(
        "--size-mm scales and moves the mesh, and a .traj file stays where it was measured: leave it out, or "
        "set "
        "--mesh-unit");
  if (handIsTrajectory || !options.compare.empty()) return;
  for (const char* name : {"--traj-columns", "--traj-unit", "--traj-time-unit", "--traj-force"}) {
    if (command.count(name) > 0)
      throw std::runtime_error(std::string(name) + " needs a .traj file at --hand or --compare");
  }
}

int run(const CLI::App& command, const RenderCommandOptions& options) {
  for (const std::string& input :
       {options.session, options.mesh.mesh, options.mesh.hand, options.mesh.compare}) {
    keepFile(options.mesh.out, options.force, input);
    keepFile(options.report, options.force, input);
  }
  if (!options.session.empty()) {
    const auto place = [](const std::string& file) { return std::filesystem::weakly_canonical(file); };
    if (!options.report.empty() && place(options.report) == place(options.mesh.out))
      throw std::runtime_error("--out and --report name one file: give each its own");
    for (const char* name :
         {"--mesh", "--hand", "--compare", "--mesh-unit", "--size-mm", "--faces", "--timing",
          "--traj-columns", "--traj-unit", "--traj-time-unit", "--traj-force"}) {
      if (command.count(name) == 0) continue;
      throw std::runtime_error(std::string(name) +
                               " does not go with --session, which has its own scene and hand: leave one of "
                               "them out");
    }
    return renderSession({.session = options.session,
                          .out = options.mesh.out,
                          .report = options.report,
                          .changes = changesOf(command, options.mesh)});
  }
  if (options.mesh.mesh.empty() || options.mesh.hand.empty() || options.mesh.out.empty()) {
    std::fprintf(stderr, "hapticd: nothing to render: give --mesh, --hand and --out, or --session\n");
    return 2;
  }
  if (!options.report.empty()) throw std::runtime_error("--report needs a --session to compare with");
  checkTrajectories(command, options.mesh);
  return renderMesh(options.mesh);
}

}  // namespace

void addRender(CLI::App& app) {
  auto options = std::make_shared<RenderCommandOptions>();
  CLI::App* command = app.add_subcommand(
      "render", "Render a mesh along a recorded hand, or re-render a recording; offline and deterministic");
  addMeshOptions(*command, options->mesh);
  addTrajectoryOptions(*command, options->mesh.trajectory);
  command->add_option("--session", options->session, "Recording of 'hapticd serve --record' to re-render")
      ->check(existingFile());
  command->add_option("--out", options->mesh.out, "CSV to write, one row for each tick");
  command->add_option("--report", options->report,
                      "With --session: HTML page with plots of force and depth, recorded and re-rendered");
  command->add_flag("--force", options->force, kForceText);
  addSurfaceOptions(*command, options->mesh);
  command->footer(
      "With --mesh, --out has the columns of 'hapticd export --to csv' (docs/recording.md): hip_[xyz]_m, "
      "proxy_[xyz]_m,\n"
      "force_[xyz]_N (on the hand), depth_m, ... Device frame: +x right, +y up, +z to the user.\n"
      "A .traj file is text with one sample on each line: t x y z [fx fy fz], in s, mm and N unless "
      "--traj-...\n"
      "options say otherwise, in the frame of the mesh. --compare prints the RMS error of the force, the "
      "angle\n"
      "between the forces, and the distance of the proxy. Data and formulas: docs/measured-trajectories.md.\n"
      "With --session, options change surfaces (of all objects and planes), tool radius and guard; all else "
      "stays as\n"
      "recorded. Without changes the forces equal the recorded ones bit for bit, or the exit status is 1.\n"
      "Examples:\n"
      "  hapticd render --mesh bunny.obj --hand stroke.csv --out felt.csv --raw\n"
      "  hapticd render --mesh plane.obj --hand in.traj --raw --out felt.csv --compare probe.traj\n"
      "  hapticd render --session my.haptics\n"
      "  hapticd render --session my.haptics --stiffness 300 --report softer.html");
  command->callback([options, command] { exitCode = run(*command, *options); });
}

}  // namespace hapticd::apps
