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

}  // namespace

PlacedPlanes::Memory& PlacedPlanes::memoryOf(const scene::Plane& plane, Nanos now, double depth_m,
                                             bool& fresh) noexcept {
  const auto end = memory_.begin() + memoryCount_;
  const auto known =
      std::find_if(memory_.begin(), end, [&](const Memory& m) { return m.index == plane.index; });
  if (known == end) ++memoryCount_;
  fresh = known == end || known->placement != plane.placement;
  if (fresh) {
    *known = Memory{};
    known->index = plane.index;
    known->placement = plane.placement;
    known->placed = now;
    known->depth_m = std::max(0.0, depth_m);
  }
  return *known;
}

// Height of the surface above the plane itself, metres.
double PlacedPlanes::heightOf(const scene::Plane& plane, const Memory& memory, Nanos now, const Vec3& normal,
                              const Vec3& proxy, double metresPerUnit) noexcept {
  const double age = base::toSeconds(now - memory.placed);
  const double recovery = base::toSeconds(plane.recovery);
  double height = 0;
  if (age < recovery) height -= memory.depth_m * (1 - age / recovery);
  if (plane.textureWavelength > 0) {
    // The first contact becomes the centre of the texture, so the HIP always meets a crest.
    const Vec3 offset = memory.touched ? Vec3(proxy - memory.firstContact) : Vec3(Vec3::Zero());
    const double r = (offset - normal * normal.dot(offset)).norm() / metresPerUnit;
    height += metresPerUnit * plane.textureAmplitude * std::cos(kTau * r / plane.textureWavelength);
  }
  height += metresPerUnit * plane.buzzAmplitude * std::sin(plane.buzzAngularFrequency_rad_per_s * age);
  return height;
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

bool PlacedPlanes::changesInContact(const scene::SceneSnapshot& scene) const noexcept {
  return std::any_of(memory_.begin(), memory_.begin() + memoryCount_, [&](const Memory& m) {
    const auto now = std::find_if(scene.planes.begin(), scene.planes.end(),
                                  [&](const scene::Plane& p) { return p.index == m.index; });
    return m.touched &&
           (now == scene.planes.end() || now->placement != m.placement || !(now->surface == m.surface));
  });
}

void PlacedPlanes::place(const scene::SceneSnapshot& scene, Nanos now, const Vec3& hip, const Vec3& proxy,
                         double toolRadius_m, double radius_m) noexcept {
  const geometry::Affine& T_world_device = scene.workspace.T_world_device;
  changedInContact_ = changesInContact(scene);
  forgetAllExcept(scene);
  count_ = 0;
  leavesOut_ = false;
  for (const scene::Plane& plane : scene.planes) {
    if (count_ == scene::kMaxPlanes) break;
    PlacedPlane& placed = planes_[static_cast<std::size_t>(count_)];
    placed = PlacedPlane{};
    placed.state = &plane;
    placed.facet.object = -1 - count_;
    placed.facet.radius = radius_m;
    if (placeOne(T_world_device, now, hip, proxy, toolRadius_m, placed)) ++count_;
  }
  anew_ = false;
}

bool PlacedPlanes::placeOne(const geometry::Affine& T_world_device, Nanos now, const Vec3& hip,
                            const Vec3& proxy, double toolRadius_m, PlacedPlane& placed) noexcept {
  const scene::Plane& plane = *placed.state;
  const Vec3 slope = T_world_device.linear().transpose() * plane.normal;  // world units per metre
  const double unitsPerMetre = slope.norm();
  if (!(unitsPerMetre > 0) || !std::isfinite(unitsPerMetre)) return false;
  const Vec3 normal = slope / unitsPerMetre;
  const double hipHeight = (plane.normal.dot(T_world_device * hip) + plane.offset) / unitsPerMetre;
  bool fresh = false;
  Memory& memory = memoryOf(plane, now, toolRadius_m - hipHeight, fresh);
  if (fresh) placed.insertionDepth_m = memory.depth_m;
  if (anew_) memory.touched = memory.adheres = false;
  memory.leftOut = (anew_ || memory.leftOut) && hipHeight < toolRadius_m;
  leavesOut_ |= memory.leftOut;

  memory.surface = placed.surface = plane.surface;
  if (plane.releasing && memory.releaseBegin < 0) memory.releaseBegin = now;
  const double left = remainingShare(memory.releaseBegin, plane.owner.get(), now);
  if (left == 0 || memory.leftOut) return false;
  if (left < 1) {
    placed.surface.stiffness_N_per_m *= left;
    placed.surface.damping_Ns_per_m *= left;
  }
  const double raised = heightOf(plane, memory, now, normal, proxy, 1 / unitsPerMetre);
  placed.rests = !fresh && raised == std::exchange(memory.raised_m, raised);
  placed.facet.unbounded = true;
  placed.facet.normal = normal;
  placed.facet.a = hip - normal * (hipHeight - raised);
  placed.facet.skin = kPlaneSkin * std::max(0.1, hip.cwiseAbs().maxCoeff());
  return true;
}

void PlacedPlanes::remember(unsigned touched, const Vec3& proxy) noexcept {
  for (int i = 0; i < count_; ++i) {
    for (int k = 0; k < memoryCount_; ++k) {
      Memory& memory = memory_[static_cast<std::size_t>(k)];
      if (memory.index != (*this)[i].state->index) continue;
      const bool now = (touched >> i & 1U) != 0;
      if (now && !memory.touched) memory.firstContact = proxy;
      memory.adheres = now || memory.adheres;
      memory.touched = now || memory.adheres;
    }
  }
}

bool PlacedPlanes::remember(RenderMemory& out) const noexcept {
  out.planeCount = static_cast<std::uint32_t>(memoryCount_);
  for (std::size_t i = 0; i < out.planeCount; ++i) {
    const Memory& m = memory_[i];
    if (m.touched || m.adheres || m.leftOut || m.releaseBegin >= 0) return false;
    out.planes[i] = {m.index, m.placed, m.depth_m, m.raised_m};
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
    m.placed = known->placed;
    m.depth_m = known->depth_m;
    m.raised_m = known->raised_m;
  }
}

Vec3 PlacedPlanes::adhesion(const Vec3& hip, double toolRadius_m) noexcept {
  Vec3 force = Vec3::Zero();
  for (int i = 0; i < count_; ++i) {
    const PlacedPlane& plane = (*this)[i];
    for (int k = 0; k < memoryCount_; ++k) {
      Memory& memory = memory_[static_cast<std::size_t>(k)];
      if (memory.index != plane.state->index || !memory.adheres) continue;
      const double height = plane.facet.normal.dot(hip - plane.facet.a) - toolRadius_m;
      const double pull = plane.surface.stiffness_N_per_m * std::max(0.0, height);
      if (pull > plane.state->adhesionNormal_N) {
        memory.adheres = memory.touched = false;
      } else {
        force -= pull * plane.facet.normal;
      }
    }
  }
  return force;
}

}  // namespace hapticd::realtime
