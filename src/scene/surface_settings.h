// From what a client asks of a surface to what is rendered.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "scene/commands.h"
#include "scene/config.h"
#include "scene/notice_board.h"
#include "scene/passivity.h"
#include "scene/surface.h"

namespace hapticd::scene {

/// The requested values in SI, not yet limited against each other: properties arrive one by one in any order.
class SurfaceSettings {
 public:
  /// The values at 1 of the properties.
  static Surface atOne(const SceneConfig& config);
  /// Of the property with this name; -1: there is none.
  static int numberOf(std::string_view name);
  /// One property by its name; answers by notices. False when nothing changed.
  bool set(const SetSurfaceProperty& command, const SceneConfig& config, const Call& call);
  /// All but popthrough and mass, in stock units. False when refused.
  bool set(const SetSurface& command, const SceneConfig& config, const Call& call);

  /// The surface alone within the passivity bound, friction in order; `remark` names the values that were
  /// lowered.
  Surface resolve(const PassivityBound& bound, std::string& remark) const;

 private:
  Surface asked_;
  bool staticGiven_ = false;  // dynamic friction alone is not yet a contradiction
};

/// Stock stiffness, damping and frictions in SI; clamped with warnings unless raw. Refused when one is not a
/// number.
std::optional<Surface> surfaceFromStock(double stiffness, double damping, double staticFriction,
                                        double dynamicFriction, const SceneConfig& config, const Call& call,
                                        std::string_view name, std::int32_t id);

/// Lowers damping, then stiffness, to the bound; appends what was done to `remark`.
void keepPassive(Surface& surface, const PassivityBound& bound, std::string& remark);

/// What the surface takes of the bound, in N s/m.
double loadOf(const Surface& surface, const PassivityBound& bound);
/// Lowers stiffness and damping by one factor, which it returns: with what acts beside the surface they are
/// within the bound.
double keepPassiveBeside(Surface& surface, double others_Ns_per_m, const PassivityBound& bound);

}  // namespace hapticd::scene
