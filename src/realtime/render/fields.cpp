#include "realtime/render/fields.h"

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "realtime/render/release.h"

namespace hapticd::realtime {
namespace {

Vec3 forceOf(const scene::ForceField& field, const Vec3& hip) noexcept {
  const Vec3 offset = hip - field.origin;
  const double distance = offset.norm();
  if (!(distance < field.radius)) return Vec3::Zero();
  const Vec3 force = field.force_N + field.jacobian_N_per_unit * offset;
  const double clamp = std::min(1.0, scene::ForceField::kLargest_N / std::max(force.norm(), 1e-300));
  const double fade = std::min(1.0, (field.radius - distance) / (field.rim * field.radius));
  return clamp * fade * force;
}

}  // namespace

double Fields::left(const scene::ForceField& field, Nanos now) noexcept {
  if (!field.releasing) return remainingShare(-1, field.owner.get(), now);
  for (int i = 0; i < releasingCount_; ++i) {
    Releasing& r = releasing_[static_cast<std::size_t>(i)];
    if (r.number != field.number) continue;
    r.seen = true;
    return remainingShare(r.begin, field.owner.get(), now);
  }
  if (releasingCount_ == kMaxReleasing) return 0;
  releasing_[static_cast<std::size_t>(releasingCount_++)] = {field.number, now, true};
  return remainingShare(now, field.owner.get(), now);
}

Vec3 Fields::buzz(const scene::Buzz& b, Nanos now) noexcept {
  if (!buzzing_ || buzzStart_ != b.start) {
    buzzing_ = true;
    buzzStart_ = b.start;
    buzzBegin_ = now;
    buzzReleaseBegin_ = -1;
  }
  if (b.releasing && buzzReleaseBegin_ < 0) buzzReleaseBegin_ = now;
  if (now - buzzBegin_ >= b.duration) return Vec3::Zero();
  const double share = remainingShare(buzzReleaseBegin_, b.owner.get(), now);
  return share * std::sin(b.angularFrequency_rad_per_s * base::toSeconds(now - buzzBegin_)) * b.force_N;
}

Vec3 Fields::force(const scene::SceneSnapshot& scene, const Vec3& hip, Nanos now) noexcept {
  if (scene.fields.empty() && !scene.buzz) {
    releasingCount_ = 0;
    buzzing_ = false;
    return Vec3::Zero();
  }
  for (Releasing& r : releasing_) r.seen = false;
  const Vec3 hipInWorld = scene.workspace.T_world_device * hip;
  Vec3 sum = Vec3::Zero();  // world frame
  for (const scene::ForceField& field : scene.fields) {
    sum += left(field, now) * forceOf(field, hipInWorld);
  }
  const auto end = std::remove_if(releasing_.begin(), releasing_.begin() + releasingCount_,
                                  [](const Releasing& r) { return !r.seen; });
  releasingCount_ = static_cast<int>(end - releasing_.begin());
  if (scene.buzz) {
    sum += buzz(*scene.buzz, now);
  } else {
    buzzing_ = false;
  }
  return rotated(scene.workspace.T_device_world, sum);
}

}  // namespace hapticd::realtime
