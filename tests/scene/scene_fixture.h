// A builder with simulated time, and the few things that every test of it says.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "scene/builder.h"

namespace hapticd::scene {

inline constexpr Nanos kMillisecond = 1'000'000;

inline std::array<double, 16> columns(const geometry::Mat4& m) {
  std::array<double, 16> out;
  Eigen::Map<geometry::Mat4>(out.data()) = m;
  return out;
}

inline std::array<double, 16> columns(const Affine& t) {
  geometry::Mat4 m = geometry::Mat4::Identity();
  m.topRows<3>() = t.matrix();
  return columns(m);
}

inline Affine at(double x, double y, double z) {
  return Affine(Eigen::Translation3d(x, y, z));
}

/// A unit right triangle in the plane z = 0, as one triple.
inline std::vector<Vec3f> oneTriangle() {
  return {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)};
}

/// So many of them in a row, two apart, at this height.
inline std::vector<Vec3f> soup(int triangles, float z = 0) {
  std::vector<Vec3f> v;
  for (int i = 0; i < triangles; ++i) {
    const auto x = static_cast<float>(2 * i);
    v.insert(v.end(), {Vec3f(x, 0, z), Vec3f(x + 1, 0, z), Vec3f(x, 1, z)});
  }
  return v;
}

class SceneTest : public ::testing::Test {
 protected:
  static constexpr ClientId kClient = 7;

  explicit SceneTest(SceneConfig config = {}) : builder_(simulated(std::move(config))) { publish(); }

  static SceneConfig simulated(SceneConfig config) {
    if (!config.stopwatch) config.stopwatch = [] { return Nanos{0}; };
    config.checkMeshes = false;
    return config;
  }

  template <class C>
  void say(C command, ClientId client = kClient) {
    builder_.apply(client, std::move(command), now_, notices_);
  }
  void wait(Nanos time) { now_ += time; }
  /// The newest snapshot; true when there was a new one.
  bool publish() {
    auto next = builder_.publish(now_, notices_);
    if (!next) return false;
    previous_ = std::exchange(scene_, std::move(next));
    return true;
  }
  /// Publishes at every deadline until `time` from now.
  void run(Nanos time) {
    const Nanos end = now_ + time;
    for (auto next = builder_.nextDeadline(); next && *next <= end; next = builder_.nextDeadline()) {
      ASSERT_GE(++steps_, 0);
      ASSERT_LT(steps_, 100'000) << "deadline that does not go away";
      now_ = std::max(now_, *next);
      publish();
    }
    now_ = end;
    publish();
  }

  /// An object that can be felt, published.
  void makeTouchable(std::int32_t id, std::vector<Vec3f> vertices = oneTriangle()) {
    say(SetObjectNumber{id + 1});
    say(SetVertices{id, 0, std::move(vertices)});
    say(SetSurfaceProperty{id, "stiffness", 0.5});
    wait(20 * kMillisecond);
    publish();
  }

  const ObjectState* object(std::int32_t id) const {
    for (const auto& o : scene_->objects) {
      if (o->id == id) return o.get();
    }
    return nullptr;
  }

  /// The only notice since the last time, or what is wrong with that.
  std::string onlyNotice(Notice::Severity severity) {
    std::string text = notices_.size() == 1 ? notices_[0].text : std::to_string(notices_.size()) + " notices";
    if (notices_.size() == 1 && notices_[0].severity != severity) text = "wrong severity: " + text;
    for (const Notice& n : notices_) {
      if (notices_.size() > 1) text += "\n" + n.text;
    }
    notices_.clear();
    return text;
  }

  Nanos now_ = 1'000'000'000;
  int steps_ = 0;
  std::vector<Notice> notices_;
  SceneBuilder builder_;
  std::shared_ptr<const SceneSnapshot> scene_;
  std::shared_ptr<const SceneSnapshot> previous_;
};

}  // namespace hapticd::scene
