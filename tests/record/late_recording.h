// A servo with its scene, tick by tick, and a recording that begins when it has run for a while, as the
// server begins it.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/time.h"
#include "device/device.h"
#include "geometry/triangle_mesh.h"
#include "geometry/types.h"
#include "realtime/remote/remote_input.h"
#include "realtime/servo/guard_control.h"
#include "realtime/servo/report.h"
#include "realtime/servo/tick.h"
#include "record/recorder.h"
#include "record/recording.h"
#include "scene/builder.h"
#include "scene/commands.h"
#include "scene/force_owner.h"
#include "scene/last_commands.h"
#include "scene/notice.h"

namespace hapticd::test {

class LateRecording {
 public:
  using Vec3 = geometry::Vec3;
  static constexpr base::Nanos kTick = 1'000'000;
  static constexpr std::size_t kBatch_bytes = 8192;

  /// The damping of the bare arm is that of RenderOptions.
  explicit LateRecording(double bareDamping_Ns_per_m = std::numeric_limits<double>::infinity())
      : device_(describedDevice(bareDamping_Ns_per_m)) {
    // A box from 0 to 20 mm; an object without a placement is in metres.
    send(scene::SetVertices{0, 0, boxPoints()});
    send(scene::SetTriangles{0, 0, boxTriangles(), false});
    send(scene::SetSurface{0, 0.8, 0.001, 0.4, 0.3});
  }

  void send(scene::SceneCommand command, scene::ClientId client = 1) {
    if (recorder_) recorder_->recordCommand(0, client, now_, &command);
    builder_.apply(client, std::move(command), now_, notices_);
    changed_ = true;
  }
  void leave(scene::ClientId client) {
    if (recorder_) recorder_->recordCommand(0, client, now_, nullptr);
    builder_.clientGone(client, now_);
    owners_->forget(client);
    changed_ = true;
  }
  /// The box, by its placement and by its points.
  void move(double y_m) { send(scene::SetObjectPosition{0, {0, y_m, 0}}); }
  void raise(double y_m) {
    std::vector<geometry::Vec3f> points = boxPoints();
    for (geometry::Vec3f& point : points) point.y() += static_cast<float>(y_m);
    send(scene::SetVertices{0, 0, std::move(points)});
  }
  /// Sends another box, with its floor at this height and without a batch, triangle by triangle. More than 12
  /// repeat the first ones.
  void upload(std::int32_t object, double y_m, int count, const std::function<void(int)>& beforeEach,
              const std::function<void()>& afterEach) {
    std::vector<geometry::Vec3f> points = boxPoints();
    for (geometry::Vec3f& point : points) point.y() += static_cast<float>(y_m);
    points.push_back(points.front());  // so that it is another mesh, not the same one deformed
    send(scene::SetVertices{object, 0, std::move(points)});
    const std::vector<geometry::Triangle> triangles = boxTriangles();
    for (int i = 0; i < count; ++i) {
      beforeEach(i);
      const geometry::Triangle& t = triangles[static_cast<std::size_t>(i) % triangles.size()];
      send(scene::SetTriangles{object, i, {{t[1], t[2], t[0]}}, true});  // what stays would be no edit
      afterEach();
    }
  }
  /// The scene takes so long from one reading of its stopwatch to the next.
  void slowDown(base::Nanos reading) { reading_ = reading; }
  /// The same as far as the servo knows; leave() follows when the scene is less busy.
  void leaveBusyScene(scene::ClientId client) { owners_->leave(client, now_); }
  /// What the client commands from here on exerts force again.
  void comeBack(scene::ClientId client) { owners_->comeBack(client, owners_->leaves(client)); }
  void stream(const realtime::RemoteInput& input) { tick_.remote().write(input); }
  realtime::GuardControl& control() { return tick_.control(); }
  base::Nanos now() const { return now_; }
  const realtime::TickReport& last() const { return tick_.last(); }

  /// The hand glides to a place, ever more slowly.
  void glide(const Vec3& place_mm, int ticks) {
    const Vec3 way = hand_.position_m - 1e-3 * place_mm;
    for (int i = 1; i <= ticks; ++i) {
      const double left = std::exp(-0.02 * i);
      hand_.position_m = 1e-3 * place_mm + left * way;
      hand_.velocity_m_per_s = -20 * left * way;
      step();
    }
  }

  void record(const std::filesystem::path& file) {
    record::RecorderOptions options;
    options.ticks = 1U << 13U;
    auto recorder = std::make_unique<record::Recorder>(
        file, [](record::RecorderProblem, const std::string& text) { ADD_FAILURE() << text; }, options);
    recorder->addDevice(device_);
    recorder->start(0, "");
    owners_->watch([r = recorder.get()](scene::ClientId client, std::optional<base::Nanos> left) {
      r->recordLeft(0, client, left.value_or(0));
    });
    for (const scene::ClientCommand& c : builder_.commands(now_))
      recorder->recordCommand(0, c.client, c.at, &c.command);
    recorder->recordPublish(0, now_ - 200 * kTick, builder_.revision());
    for (const scene::ClientCommand& c : builder_.editsUnderWay(now_))
      recorder->recordCommand(0, c.client, c.at, &c.command);
    tick_.recordTo({.ticks = &recorder->ring(0),
                    .streams = &recorder->streamRing(0),
                    .memories = &recorder->memoryRing(0),
                    .revision = builder_.revisionWith(now_).value_or(realtime::Tick::Rings::kUnknown)});
    recorder_ = std::move(recorder);
    if (!builder_.revisionWith(now_)) unshown_ = now_;
  }
  void end() {
    tick_.recordTo({});
    owners_->watch(nullptr);
    recorder_->finish();
    recorder_.reset();
  }

 private:
  class GlidingHand final : public device::Device {
   public:
    void open() override {}
    void close() noexcept override {}
    const device::DeviceProfile& profile() const noexcept override { return profile_; }
    bool read(base::Nanos now, device::DeviceState& state) noexcept override {
      state.time = now;
      state.position_m = position_m;
      state.velocity_m_per_s = velocity_m_per_s;
      return true;
    }
    bool write(const Vec3&) noexcept override { return true; }

    Vec3 position_m{0.001, 0.030, 0.002};
    Vec3 velocity_m_per_s = Vec3::Zero();

   private:
    const device::DeviceProfile profile_;
  };

  static std::vector<geometry::Vec3f> boxPoints() {
    constexpr float kHalf = 0.015F;
    constexpr float kTop = 0.020F;
    return {{-kHalf, 0, -kHalf},    {kHalf, 0, -kHalf},    {kHalf, 0, kHalf},    {-kHalf, 0, kHalf},
            {-kHalf, kTop, -kHalf}, {kHalf, kTop, -kHalf}, {kHalf, kTop, kHalf}, {-kHalf, kTop, kHalf}};
  }

  static std::vector<geometry::Triangle> boxTriangles() {
    return {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}, {0, 5, 1}, {0, 4, 5},
            {1, 6, 2}, {1, 5, 6}, {2, 7, 3}, {2, 6, 7}, {3, 4, 0}, {3, 7, 4}};
  }

  static record::RecordedDevice describedDevice(double bareDamping_Ns_per_m) {
    record::RecordedDevice device;
    device.names = {"Phantom"};
    device.driver = "simulated";
    device.sceneConfig.limits.batch_bytes = kBatch_bytes;
    device.tick.guard.armed = true;
    device.tick.guard.peakForce_N = 4;
    device.tick.guard.continuousForce_N = 1;
    device.tick.render.bareDamping_Ns_per_m = bareDamping_Ns_per_m;
    return device;
  }

  scene::SceneConfig withStopwatch() {
    scene::SceneConfig config = device_.sceneConfig;
    config.stopwatch = [this] { return readings_.emplace_back(stopwatch_ += reading_); };
    config.owners = owners_;
    return config;
  }

  void step() {
    now_ += kTick;
    const auto due = builder_.nextDeadline();
    if (std::exchange(changed_, false) || (due && *due <= now_)) {
      readings_.clear();
      const auto snapshot = builder_.publish(now_, notices_);
      if (recorder_) recorder_->recordPublish(0, now_, snapshot ? snapshot->revision : 0, readings_);
      if (const auto shown = unshown_ ? builder_.revisionWith(*unshown_) : std::nullopt) {
        tick_.rememberFrom(*shown);
        unshown_.reset();
      }
      if (snapshot) tick_.snapshots().publish(snapshot);
    }
    clock_.sleepUntil(now_);
    tick_(now_);
  }

  const record::RecordedDevice device_;
  base::Nanos now_ = 1'000'000'000;
  std::vector<base::Nanos> readings_;  // of the stopwatch, in the publication at hand
  base::Nanos reading_ = 1000;
  base::Nanos stopwatch_ = 0;
  std::vector<scene::Notice> notices_;
  bool changed_ = false;
  std::optional<base::Nanos> unshown_;  // the begin of a recording, until all edits before it are published
  const std::shared_ptr<scene::ForceOwners> owners_ = std::make_shared<scene::ForceOwners>();
  scene::SceneBuilder builder_{withStopwatch()};
  base::SimulatedClock clock_;
  GlidingHand hand_;
  realtime::Tick tick_{hand_, clock_, device_.tick};
  std::unique_ptr<record::Recorder> recorder_;
};

}  // namespace hapticd::test
