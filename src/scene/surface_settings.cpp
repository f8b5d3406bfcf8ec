#include "scene/surface_settings.h"

#include <algorithm>
#include <utility>

#include "scene/matrices.h"

namespace hapticd::scene {
namespace {

constexpr double kReferenceStiffness_N_per_m = 500;
constexpr double kReferenceDamping_Ns_per_m = 2;
constexpr double kReferenceForce_N = 3.3;
constexpr double kStockStiffness_N_per_m = 1000;
constexpr double kStockDamping_Ns_per_m = 1000;
constexpr double kStockMaxDamping = 0.005;

// Floats that a client meant as the limit are the limit.
constexpr double kRounding = 1e-6;

double clampStock(double value, double max, bool raw, std::string_view what, const Call& call,
                  std::string_view name, std::int32_t id) {
  const double limit = raw ? std::numeric_limits<double>::infinity() : max;
  if (value >= 0 && value <= limit * (1 + kRounding)) return value;
  const double clamped = std::clamp(value, 0.0, limit);
  call.warn(name, "out of range, clamped", " ", id, ", ", what, " ", value, " is not within 0 to ", max, ", ",
            clamped, " is used");
  return clamped;
}

void append(std::string& remark, const std::string& part) {
  remark += (remark.empty() ? "" : "; ") + part;
}

}  // namespace

Surface SurfaceSettings::atOne(const SceneConfig& config) {
  const bool ofDevice = config.materialScale == MaterialScale::device;
  return {.stiffness_N_per_m = ofDevice ? config.nominalStiffness_N_per_m : kReferenceStiffness_N_per_m,
          .damping_Ns_per_m = kReferenceDamping_Ns_per_m,
          .staticFriction = 1,
          .dynamicFriction = 1,
          .popthrough_N = ofDevice ? config.nominalForce_N : kReferenceForce_N,
          .mass_kg = 1};
}

int SurfaceSettings::numberOf(std::string_view name) {
  constexpr std::string_view kNames[] = {"stiffness",        "damping",    "static friction",
                                         "dynamic friction", "popthrough", "mass"};
  const auto* known = std::find(std::begin(kNames), std::end(kNames), name);
  return known == std::end(kNames) ? -1 : static_cast<int>(known - std::begin(kNames));
}

bool SurfaceSettings::set(const SetSurfaceProperty& command, const SceneConfig& config, const Call& call) {
  constexpr std::string_view kName = "setHapticProperty";
  struct Row {
    std::string_view name;
    double Surface::*member;
    double max;
  };
  const double infinity = std::numeric_limits<double>::infinity();
  const double one = config.raw ? infinity : 1.0;
  const Row rows[] = {
      {"stiffness", &Surface::stiffness_N_per_m, one},
      {"damping", &Surface::damping_Ns_per_m, one},
      {"static friction", &Surface::staticFriction, one},
      {"dynamic friction", &Surface::dynamicFriction, one},
      {"popthrough", &Surface::popthrough_N, one},
      {"mass", &Surface::mass_kg, infinity},
  };
  const Row* row =
      std::find_if(std::begin(rows), std::end(rows), [&](const Row& r) { return r.name == command.name; });
  if (row == std::end(rows)) {
    call.warn(kName,
              "unknown property, ignored; use stiffness, damping, static friction, dynamic friction, "
              "popthrough or mass",
              " object ", command.object, ", '", command.name, "'");
    return false;
  }
  if (!isUsable(command.value)) {
    call.refuse(kName, "not finite or too large, the old value stays", " object ", command.object, ", ",
                command.name, " ", command.value);
    return false;
  }
  const double value = std::clamp(command.value, 0.0, row->max);
  if (value != command.value) {
    call.warn(kName, "out of range, clamped", " object ", command.object, ", ", command.name, " ",
              command.value, " becomes ", value);
  }
  const double before = asked_.*row->member;
  asked_.*row->member = value * (atOne(config).*row->member);
  const bool firstStatic = row->member == &Surface::staticFriction && !std::exchange(staticGiven_, true);
  // The first static friction may lower the dynamic one, which the client is told, also where it is the 0 of
  // before.
  return asked_.*row->member != before || firstStatic;
}

bool SurfaceSettings::set(const SetSurface& command, const SceneConfig& config, const Call& call) {
  const std::optional<Surface> stock =
      surfaceFromStock(command.stiffness, command.damping, command.staticFriction, command.dynamicFriction,
                       config, call, "updateTrimeshChanges object", command.object);
  if (!stock) return false;
  asked_.stiffness_N_per_m = stock->stiffness_N_per_m;
  asked_.damping_Ns_per_m = stock->damping_Ns_per_m;
  asked_.staticFriction = stock->staticFriction;
  asked_.dynamicFriction = stock->dynamicFriction;
  staticGiven_ = true;
  return true;
}

Surface SurfaceSettings::resolve(const PassivityBound& bound, std::string& remark) const {
  Surface surface = asked_;
  if (surface.dynamicFriction > surface.staticFriction) {
    if (staticGiven_) {
      append(remark, "dynamic friction " + textOf(surface.dynamicFriction) + " is above static friction " +
                         textOf(surface.staticFriction) + " and is lowered to it");
    }
    surface.dynamicFriction = surface.staticFriction;
  }
  keepPassive(surface, bound, remark);
  return surface;
}

std::optional<Surface> surfaceFromStock(double stiffness, double damping, double staticFriction,
                                        double dynamicFriction, const SceneConfig& config, const Call& call,
                                        std::string_view name, std::int32_t id) {
  for (const double value : {stiffness, damping, staticFriction, dynamicFriction}) {
    if (isUsable(value)) continue;
    call.refuse(name, "refused: not finite or too large, the old surface stays", " ", id, ", ", value);
    return std::nullopt;
  }
  const auto clamp = [&](double value, double max, std::string_view what) {
    return clampStock(value, max, config.raw, what, call, name, id);
  };
  Surface surface;
  surface.stiffness_N_per_m = kStockStiffness_N_per_m * clamp(stiffness, 1, "stiffness");
  surface.damping_Ns_per_m = kStockDamping_Ns_per_m * clamp(damping, kStockMaxDamping, "damping");
  surface.staticFriction = clamp(staticFriction, 1, "static friction");
  surface.dynamicFriction = clamp(dynamicFriction, 1, "dynamic friction");
  return surface;
}

void keepPassive(Surface& surface, const PassivityBound& bound, std::string& remark) {
  if (const double max = bound.maxStiffness_N_per_m(); surface.stiffness_N_per_m > max) {
    append(remark, "stiffness " + textOf(surface.stiffness_N_per_m) +
                       " N/m would be unstable on this device and is lowered to " + textOf(max));
    surface.stiffness_N_per_m = max;
  }
  const double max = std::max(0.0, bound.maxDamping_Ns_per_m(surface.stiffness_N_per_m));
  if (surface.damping_Ns_per_m > max) {
    append(remark, "damping " + textOf(surface.damping_Ns_per_m) + " N s/m beside stiffness " +
                       textOf(surface.stiffness_N_per_m) +
                       " N/m would be unstable on this device and is lowered to " + textOf(max));
    surface.damping_Ns_per_m = max;
  }
}

double loadOf(const Surface& surface, const PassivityBound& bound) {
  return bound.loadOf({surface.stiffness_N_per_m, surface.damping_Ns_per_m});
}

double keepPassiveBeside(Surface& surface, double others_Ns_per_m, const PassivityBound& bound) {
  const double load = loadOf(surface, bound);
  if (load == 0 || others_Ns_per_m == 0) return 1;
  const double share = bound.shareOf(load + others_Ns_per_m);
  surface.stiffness_N_per_m *= share;
  surface.damping_Ns_per_m *= share;
  return share;
}

}  // namespace hapticd::scene
