// Forces that depend on the HIP and not on contact: force fields and the buzz (custom effect 0).
#pragma once

#include <array>

#include "base/time.h"
#include "realtime/render/memory.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Vec3;

/// Start times of the buzz and of fields that ramp out. Servo thread: noexcept, no allocation.
class Fields {
 public:
  /// Sum of all forces at the HIP (device metres), device frame, newtons.
  Vec3 force(const scene::SceneSnapshot& scene, const Vec3& hip, Nanos now) noexcept;
  void reset() noexcept { *this = Fields{}; }
  /// False while one ramps out: its share is not part of the memory.
  bool remember(RenderMemory& out) const noexcept {
    out.buzzBegin = buzzBegin_;
    return releasingCount_ == 0 && !(buzzing_ && buzzReleaseBegin_ >= 0);
  }
  /// Continues the buzz, if one runs.
  void resume(const RenderMemory& memory) noexcept { buzzBegin_ = memory.buzzBegin; }

 private:
  static constexpr int kMaxReleasing = 16;

  struct Releasing {
    std::uint32_t number = 0;
    Nanos begin = 0;
    bool seen = false;
  };

  double left(const scene::ForceField& field, Nanos now) noexcept;
  Vec3 buzz(const scene::Buzz& buzz, Nanos now) noexcept;

  std::array<Releasing, kMaxReleasing> releasing_;
  int releasingCount_ = 0;
  bool buzzing_ = false;
  std::uint32_t buzzStart_ = 0;
  Nanos buzzBegin_ = 0;
  Nanos buzzReleaseBegin_ = -1;
};

}  // namespace hapticd::realtime
