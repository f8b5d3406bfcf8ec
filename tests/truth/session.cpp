#include "truth/session.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "base/clock.h"
#include "realtime/servo/tick.h"
#include "record/recorder.h"
#include "scene/builder.h"

namespace hapticd::truth {
namespace {

constexpr base::Nanos kTickTime = 1'000'000;
constexpr base::Nanos kBuilt = 1'000'000'000;  // after the pause that the builder waits for
constexpr scene::ClientId kClient = 1;

class TrialHand final : public device::Device {
 public:
  explicit TrialHand(const Trial& trial) : trial_(trial) {}

  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(base::Nanos now, device::DeviceState& state) noexcept override {
    const Point& hip = trial_.hips[next_];
    state.time = now;
    state.velocity_m_per_s =
        next_ > 0 ? Point((hip - trial_.hips[next_ - 1]) / kPeriod_s) : Point(Point::Zero());
    state.position_m = hip;
    ++next_;
    return true;
  }
  bool write(const geometry::Vec3& /*force_N*/) noexcept override { return true; }

 private:
  const Trial& trial_;
  const device::DeviceProfile profile_;
  std::size_t next_ = 0;
};

std::array<double, 16> matrixOf(const Pose& pose) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = pose.rotation.toRotationMatrix() * pose.scale.asDiagonal();
  m.topRightCorner<3, 1>() = pose.position_m;
  std::array<double, 16> out;
  std::copy_n(m.data(), out.size(), out.begin());
  return out;
}

// Values that give the same surface: properties count in 500 N/m, 2 N s/m and 3.3 N.
void addSurface(std::int32_t id, const Material& m, std::vector<scene::SceneCommand>& out) {
  out.emplace_back(scene::SetSurfaceProperty{id, "stiffness", m.stiffness_N_per_m / 500});
  out.emplace_back(scene::SetSurfaceProperty{id, "damping", m.damping_Ns_per_m / 2});
  out.emplace_back(scene::SetSurfaceProperty{id, "static friction", m.staticFriction});
  out.emplace_back(scene::SetSurfaceProperty{id, "dynamic friction", m.dynamicFriction});
  out.emplace_back(scene::SetSurfaceProperty{id, "popthrough", m.popthrough_N / 3.3});
}

std::vector<scene::SceneCommand> commandsOf(const Trial& trial) {
  std::vector<scene::SceneCommand> out;
  out.emplace_back(scene::SetTouchableFaces{static_cast<std::int32_t>(trial.sides)});
  for (std::size_t i = 0; i < trial.objects.size(); ++i) {
    const TrialObject& object = trial.objects[i];
    const auto id = static_cast<std::int32_t>(i + 1);
    out.emplace_back(scene::AddObject{id, -1});
    out.emplace_back(scene::SetVertices{id, 0, object.vertices});
    out.emplace_back(scene::SetTriangles{id, 0, object.triangles, false});
    out.emplace_back(scene::SetTransform{id, matrixOf(object.poses[0])});
    addSurface(id, object.material, out);
  }
  return out;
}

record::RecordedDevice deviceOf(const Trial& trial) {
  record::RecordedDevice device;
  device.names = {"judge"};
  device.driver = "trial";
  device.sceneConfig.raw = true;
  device.sceneConfig.checkMeshes = false;
  device.tick.render.toolRadius_m = trial.toolRadius_m;
  device.tick.guard.enabled = false;
  return device;
}

}  // namespace

bool writeSession(const Trial& trial, const std::filesystem::path& file) {
  if (!trial.isStatic() || !trial.planes.empty()) return false;
  std::filesystem::remove(file);
  record::Recorder recorder(
      file, [](record::RecorderProblem, const std::string& problem) { throw std::runtime_error(problem); },
      {.ticks = trial.hips.size() + 1});
  record::RecordedDevice device = deviceOf(trial);
  recorder.addDevice(device);
  device.sceneConfig.stopwatch = [] { return base::Nanos{0}; };
  scene::SceneBuilder builder(device.sceneConfig);
  TrialHand hand(trial);
  base::SimulatedClock clock;
  realtime::Tick tick(hand, clock, device.tick);
  tick.recordTo({.ticks = &recorder.ring(0)});
  recorder.start(0, "");

  std::vector<scene::Notice> notices;
  for (scene::SceneCommand& command : commandsOf(trial)) {
    recorder.recordCommand(0, kClient, 0, &command);
    builder.apply(kClient, std::move(command), 0, notices);
  }
  auto snapshot = builder.publish(kBuilt, notices);
  recorder.recordPublish(0, kBuilt, snapshot->revision);
  tick.snapshots().publish(std::move(snapshot));
  for (std::size_t i = 0; i < trial.hips.size(); ++i) {
    const base::Nanos now = kBuilt + static_cast<base::Nanos>(i + 1) * kTickTime;
    clock.sleepUntil(now);
    tick(now);
  }
  recorder.finish();
  return true;
}

}  // namespace hapticd::truth
