#include "realtime/render/placed_planes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/time.h"
#include "realtime/render/release.h"

namespace hapticd::realtime {
namespace {

constexpr double kPlaneSkin = 1e-9;  // of the largest coordinate of the HIP
constexpr double kTau = 2 * M_PI;
constexpr double kFastest_m_per_s = 1;

// What is left to rise after a placement.
double missingOf(const scene::Plane& plane, double depth_m, Nanos age) noexcept {
  const double age_s = base::toSeconds(age);
  const double recovery_s = std::max(base::toSeconds(plane.recovery), depth_m / kFastest_m_per_s);
  return age_s < recovery_s ? depth_m * (1 - age_s / recovery_s) : 0;
}

std::array<double, 6> detailOf(const scene::Plane& plane) noexcept {
  return {plane.adhesionNormal_N,  plane.adhesionLateral_N, plane.textureAmplitude,
          plane.textureWavelength, plane.buzzAmplitude,     plane.buzzAngularFrequency_rad_per_s};
}

}  // namespace

// A plane that moves while it is felt rises from where the HIP is below it already: by what the placement
// added, and not by what the HIP has sunk since the last tick.
PlacedPlanes::Memory& PlacedPlanes::memoryOf(const scene::Plane& plane, Nanos now, double depth_m,
                                             double sunk_m, bool& fresh) noexcept {
  const auto end = memory_.begin() + memoryCount_;
  const auto known =
      std::find_if(memory_.begin(), end, [&](const Memory& m) { return m.index == plane.index; });
  if (known == end) ++memoryCount_;
  fresh = known == end || known->placement != plane.placement;
  if (!fresh) return *known;
  const Memory before = known == end ? Memory{} : *known;
  *known = Memory{};
  known->index = plane.index;
  known->placement = plane.placement;
  known->placed = now;
  known->detail = detailOf(plane);
  const bool goesOn = known != end && before.releaseBegin < 0;
  known->buzzing = goesOn ? before.buzzing : now;
  const double under_m = std::clamp(before.level_m + sunk_m, 0.0, before.under_m + std::max(0.0, sunk_m));
  known->depth_m = std::max(0.0, depth_m + (goesOn ? before.wave_m : 0) - under_m);
  known->leftOut = before.leftOut;
  if (before.touched && before.releaseBegin < 0) {
    known->touched = true;
    known->adheres = before.adheres;
    known->firstContact = before.firstContact;
  }
  return *known;
}

// Height of the surface above the plane itself, metres.
double PlacedPlanes::heightOf(const scene::Plane& plane, Memory& memory, Nanos now,
                              double metresPerUnit) const noexcept {
  const auto onDevice = [&](double amplitude) {
    return std::min(metresPerUnit * amplitude, scene::kHighestDetail_m);
  };
  const double missing_m = missingOf(plane, memory.depth_m, now - memory.placed);
  double texture_m = 0;
  if (plane.textureWavelength > 0) {
    // The first contact becomes the centre of the texture, so the HIP always meets a crest.
    const Vec3 offset = memory.touched ? Vec3(proxy_ - memory.firstContact) : Vec3(Vec3::Zero());
    const double r = (offset - plane.normal * plane.normal.dot(offset)).norm();
    texture_m = onDevice(plane.textureAmplitude) * std::cos(kTau * r / plane.textureWavelength);
  }
  const double buzzed_s = base::toSeconds(now - memory.buzzing);
  const double buzz_m =
      onDevice(plane.buzzAmplitude) * std::sin(plane.buzzAngularFrequency_rad_per_s * buzzed_s);
  memory.wave_m = texture_m + buzz_m;
  return texture_m - missing_m + buzz_m;
}

// A plane that returns after it was removed counts as new.
void PlacedPlanes::forgetAllExcept(const scene::SceneSnapshot& scene) noexcept {
  const auto isGone = [&](const Memory& m) {
    return std::none_of(scene.planes.begin(), scene.planes.end(),
                        [&](const scene::Plane& p) { return p.index == m.index; });
  };
  const auto end = std::remove_if(memory_.begin(), memory_.begin() + memoryCount_, isGone);
  memoryCount_ = static_cast<int>(end - memory_.begin());
}

// A plane that is placed anew may lie across what is touched, and a texture rises above its plane.
bool PlacedPlanes::changes(const scene::SceneSnapshot& scene) const noexcept {
  const auto end = memory_.begin() + memoryCount_;
  const auto isNew = [&](const scene::Plane& p) {
    const auto known =
        std::find_if(memory_.begin(), end, [&](const Memory& m) { return m.index == p.index; });
    return known == end || p.placement != known->placement || detailOf(p) != known->detail ||
           (known->touched && !(p.surface == known->surface));
  };
  const auto isGone = [&](const Memory& m) {
    return m.touched && std::none_of(scene.planes.begin(), scene.planes.end(),
                                     [&](const scene::Plane& p) { return p.index == m.index; });
  };
  return std::any_of(scene.planes.begin(), scene.planes.end(), isNew) ||
         std::any_of(memory_.begin(), end, isGone);
}

bool PlacedPlanes::isTouched() const noexcept {
  return std::any_of(memory_.begin(), memory_.begin() + memoryCount_,
                     [](const Memory& m) { return m.touched; });
}

// A view that jumps leaves textures to the hand.
void PlacedPlanes::followJump(const ViewMotion& view) noexcept {
  if (!view.jumpsAt(proxyOnDevice_)) return;
  const Vec3 jump = T_world_device_ * proxyOnDevice_ - proxy_;
  for (Memory& memory : memory_) memory.firstContact += jump;
  proxy_ += jump;
}

void PlacedPlanes::place(const scene::SceneSnapshot& scene, Nanos now, const Vec3& hip, double toolRadius_m,
                         double radius_m, bool viewMoved) noexcept {
  const geometry::Affine T_world_before = std::exchange(T_world_device_, scene.workspace.T_world_device);
  if (viewMoved) followJump({scene.workspace.T_device_world, T_world_before});
  changed_ = changes(scene) || (viewMoved_ && isTouched());
  forgetAllExcept(scene);
  count_ = 0;
  leavesOut_ = false;
  viewMoved_ = viewMoved;
  for (const scene::Plane& plane : scene.planes) {
    if (count_ == scene::kMaxPlanes) break;
    PlacedPlane& placed = planes_[static_cast<std::size_t>(count_)];
    placed = PlacedPlane{};
    placed.state = &plane;
    placed.facet.object = -1 - count_;
    placed.facet.radius = radius_m;
    if (placeOne(now, hip, toolRadius_m, placed)) ++count_;
  }
  anew_ = false;
  hip_ = hip;
}

bool PlacedPlanes::placeOne(Nanos now, const Vec3& hip, double toolRadius_m, PlacedPlane& placed) noexcept {
  const scene::Plane& plane = *placed.state;
  const Vec3 slope = T_world_device_.linear().transpose() * plane.normal;  // world units per metre
  const double unitsPerMetre = slope.norm();
  if (!(unitsPerMetre > 0) || !std::isfinite(unitsPerMetre)) return false;
  const Vec3 normal = slope / unitsPerMetre;
  const double hipHeight = (plane.normal.dot(T_world_device_ * hip) + plane.offset) / unitsPerMetre;
  bool fresh = false;
  const double depth_m = toolRadius_m - hipHeight;
  const double sunk_m = anew_ ? -std::numeric_limits<double>::infinity() : normal.dot(hip_ - hip);
  Memory& memory = memoryOf(plane, now, depth_m, sunk_m, fresh);
  if (anew_) memory.touched = memory.adheres = false;
  // As with objects, the hand is not lifted out of what came around it.
  const double missing_m = missingOf(plane, memory.depth_m, now - memory.placed);
  memory.rises = missing_m > 0;
  const double rise_m = depth_m + memory.wave_m - missing_m - std::max(0.0, memory.level_m + sunk_m);
  const bool cameDeep = fresh ? memory.depth_m > kLongestMotion_m : viewMoved_ && rise_m > kLongestMotion_m;
  memory.leftOut = (anew_ || cameDeep || memory.leftOut) && depth_m > 0;
  leavesOut_ |= memory.leftOut;
  memory.under_m = 0;
  memory.level_m = -std::numeric_limits<double>::infinity();

  memory.surface = placed.surface = plane.surface;
  memory.detail = detailOf(plane);
  if (plane.releasing && memory.releaseBegin < 0) memory.releaseBegin = now;
  const double left = remainingShare(memory.releaseBegin, plane.owner.get(), now);
  const double crest = std::min(plane.textureAmplitude, scene::kHighestDetail_m * unitsPerMetre);
  memory.belowCrest = plane.textureWavelength > 0 && -depth_m * unitsPerMetre < crest;
  if (left == 0 || memory.leftOut) return false;
  placed.share = left;
  placed.surface.damping_Ns_per_m *= left;
  const double whole = heightOf(plane, memory, now, 1 / unitsPerMetre);
  // It sinks instead of becoming softer, so that what is below it holds the hand in time.
  memory.level_m = depth_m + whole;
  memory.under_m = left * std::max(0.0, memory.level_m);
  const double raised = left == 1 ? whole : std::min(whole, memory.under_m - depth_m);
  placed.still = !fresh && left == 1 && raised == std::exchange(memory.raised_m, raised);
  placed.rests = placed.still && !viewMoved_;
  placed.facet.unbounded = true;
  placed.facet.normal = normal;
  placed.facet.a = hip - normal * (hipHeight - raised);
  placed.facet.skin = kPlaneSkin * std::max(0.1, hip.cwiseAbs().maxCoeff());
  return true;
}

void PlacedPlanes::remember(unsigned touched, const Vec3& proxy) noexcept {
  proxyOnDevice_ = proxy;
  proxy_ = T_world_device_ * proxy;
  for (int i = 0; i < count_; ++i) {
    for (int k = 0; k < memoryCount_; ++k) {
      Memory& memory = memory_[static_cast<std::size_t>(k)];
      if (memory.index != (*this)[i].state->index) continue;
      const bool now = (touched >> i & 1U) != 0;
      if (now && !memory.touched) memory.firstContact = proxy_;
      memory.adheres = now || memory.adheres;
      // A hand that leaves a trough meets no crest in its place.
      memory.touched = now || memory.adheres || (memory.touched && memory.belowCrest);
    }
  }
}

bool PlacedPlanes::remember(RenderMemory& out) const noexcept {
  out.planeCount = static_cast<std::uint32_t>(memoryCount_);
  for (std::size_t i = 0; i < out.planeCount; ++i) {
    const Memory& m = memory_[i];
    if (m.touched || m.adheres || m.leftOut || m.releaseBegin >= 0) return false;
    // One time for both: of a plane that has risen, the hand does not feel since when. One that does not buzz
    // yet may do so later.
    if (m.rises && m.placed != m.buzzing) return false;
    out.planes[i] = {m.index, m.rises ? m.placed : m.buzzing, m.rises ? m.depth_m : 0, m.raised_m};
  }
  return true;
}

// By the index: the numbers of the placements are those of this scene.
void PlacedPlanes::resume(const RenderMemory& memory) noexcept {
  for (int i = 0; i < memoryCount_; ++i) {
    Memory& m = memory_[static_cast<std::size_t>(i)];
    m.touched = m.adheres = false;
    const auto end = memory.planes.begin() + memory.planeCount;
    const auto known =
        std::find_if(memory.planes.begin(), end, [&](const PlaneMemory& p) { return p.index == m.index; });
    if (known == end) continue;
    m.placed = m.buzzing = known->placed;
    m.depth_m = known->depth_m;
    m.raised_m = known->raised_m;
  }
}

Adhesion PlacedPlanes::adhesion(const Vec3& hip, double toolRadius_m) noexcept {
  Adhesion adhesion;
  double hardest_N = 0;
  for (int i = 0; i < count_; ++i) {
    const PlacedPlane& plane = (*this)[i];
    for (int k = 0; k < memoryCount_; ++k) {
      Memory& memory = memory_[static_cast<std::size_t>(k)];
      if (memory.index != plane.state->index || !memory.adheres) continue;
      const double height = plane.facet.normal.dot(hip - plane.facet.a) - toolRadius_m;
      const double pull = plane.surface.stiffness_N_per_m * std::max(0.0, height);
      if (pull > plane.state->adhesionNormal_N) {
        memory.adheres = false;
        memory.touched = memory.belowCrest;
      } else {
        adhesion.force_N -= plane.share * pull * plane.facet.normal;
        if (plane.share * pull <= hardest_N) continue;
        hardest_N = plane.share * pull;
        adhesion.point_m = hip - (height + toolRadius_m) * plane.facet.normal;
      }
    }
  }
  return adhesion;
}

}  // namespace hapticd::realtime
