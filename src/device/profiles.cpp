#include "device/profiles.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <limits>

namespace hapticd::device {
namespace {

struct Row {
  const char* model;
  const char* alias;
  double width_mm, height_mm, depth_mm;
  double peak_N, continuous_N;
  double stiffness_N_per_m, damping_Ns_per_m;
  double bareDamping_Ns_per_m;
  int buttons;
  std::uint32_t switches;
  int inputDof, outputDof;
};

// The damping (device plus grip, and the bare arm) is a design choice, not measured.
constexpr double kHeld = std::numeric_limits<double>::infinity();
constexpr Row kRows[] = {
    {"simulated", "", 160, 120, 70, 3.3, 3.3, 1000, 5, kHeld, 2, kHoldNone, 6, 3},
    {"Touch", "Omni", 160, 120, 70, 3.3, 0.88, 500, 2.5, 0.1, 2, kHoldInkwell, 6, 3},
    {"Touch X", "Desktop", 160, 120, 120, 7.9, 1.75, 1000, 3, 0.1, 2, kHoldNone, 6, 3},
    {"Premium 1.5", "", 381, 267, 191, 8.5, 1.4, 1000, 3, 0.05, 1, kHoldNone, 6, 3},
    {"omega.3", "", 160, 160, 110, 12, 12, 5000, 30, 0.3, 1, kHoldNone, 3, 3},
    {"delta.3", "", 400, 400, 260, 20, 20, 5000, 30, 0.3, 1, kHoldNone, 3, 3},
    {"sigma.7", "", 190, 190, 130, 12, 12, 4000, 30, 0.3, 2, kHoldNone, 7, 7},
    {"Inverse3", "", 240, 160, 160, 7, 4, 1000, 3, 0.1, 3, kHoldNone, 3, 3},
    {"lambda.7", "", 200, 200, 150, 12, 12, 8000, 30, 0.3, 2, kHoldNone, 7, 7},
};

std::array<DeviceProfile, std::size(kRows)> build() {
  std::array<DeviceProfile, std::size(kRows)> all;
  std::transform(std::begin(kRows), std::end(kRows), all.begin(), [](const Row& row) {
    const Vec3 half = 0.0005 * Vec3(row.width_mm, row.height_mm, row.depth_mm);
    DeviceProfile profile;
    profile.model = row.model;
    profile.workspace_m = {-half, half};
    profile.peakForce_N = row.peak_N;
    profile.continuousForce_N = row.continuous_N;
    profile.nominalStiffness_N_per_m = row.stiffness_N_per_m;
    profile.ownDamping_Ns_per_m = row.damping_Ns_per_m;
    profile.buttons = row.buttons;
    profile.switches = row.switches;
    profile.inputDof = row.inputDof;
    profile.outputDof = row.outputDof;
    profile.hasGripper = row.inputDof == 7;
    profile.startsArmed = &row == std::begin(kRows);
    return profile;
  });
  return all;
}

bool sameName(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

}  // namespace

std::span<const DeviceProfile> profiles() {
  static const auto all = build();
  return all;
}

const DeviceProfile* findProfile(std::string_view model) {
  if (model.empty()) return nullptr;
  for (std::size_t i = 0; i < std::size(kRows); ++i) {
    if (sameName(model, kRows[i].model) || sameName(model, kRows[i].alias)) return &profiles()[i];
  }
  return nullptr;
}

double bareDampingOf(std::string_view model) {
  const DeviceProfile* const known = findProfile(model);
  return known == nullptr ? 0 : kRows[known - profiles().data()].bareDamping_Ns_per_m;
}

std::string inWords(const DeviceProfile& profile) {
  const Vec3 mm = 1000 * profile.workspace_m.extents();
  char figures[256];
  std::snprintf(
      figures, sizeof figures,
      ": %.0f x %.0f x %.0f mm, %.3g N (%.3g N for long), %.4g N/m, %.3g Ns/m, %d degrees of freedom "
      "in and %d out, %d button%s",
      mm.x(), mm.y(), mm.z(), profile.peakForce_N, profile.continuousForce_N,
      profile.nominalStiffness_N_per_m, profile.ownDamping_Ns_per_m, profile.inputDof, profile.outputDof,
      profile.buttons, profile.buttons == 1 ? "" : "s");
  std::string words = profile.model + figures;
  if ((profile.switches & kHoldInkwell) != 0) words += ", inkwell switch";
  if ((profile.switches & kHoldDeadMan) != 0) words += ", presence switch";
  if (profile.hasGripper) words += ", gripper";
  return words;
}

}  // namespace hapticd::device
