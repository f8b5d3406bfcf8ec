// What a tick costs against the bare first-hit query of the index on the same segments.
#include <map>
#include <optional>
#include <thread>

#include "base/clock.h"
#include "bench/all.h"
#include "bench/bare_index.h"
#include "bench/scenes.h"
#include "bench/timing.h"
#include "realtime/render/renderer.h"
#include "realtime/servo/tick.h"

namespace hapticd::bench {
namespace {

constexpr base::Nanos kTickPeriod = 1'000'000;
constexpr std::size_t kBlock = 250;  // ticks of one before the other has its turn

// A hand that is where it is told, for a whole turn of the servo.
class ToldDevice final : public device::Device {
 public:
  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(base::Nanos now, device::DeviceState& state) noexcept override {
    state.time = now;
    state.position_m = position_m;
    return true;
  }
  bool write(const Vec3& /*force_N*/) noexcept override { return true; }
  Vec3 position_m = Vec3::Zero();

 private:
  device::DeviceProfile profile_;
};

struct Segment {
  Vec3f from, to;
};

// One thing to measure: a step for each tick of the hand, in order.
class Stepper {
 public:
  virtual ~Stepper() = default;
  virtual void step(std::size_t i) = 0;  ///< measured
  virtual void after() {}                ///< not measured
};

class Rendered final : public Stepper {
 public:
  Rendered(const scene::SceneSnapshot& scene, const std::vector<HandTick>& hand, double radius_m)
      : scene_(scene), hand_(hand), renderer_({.toolRadius_m = radius_m, .forceShading = false}) {}
  void step(std::size_t i) override {
    state_.position_m = hand_[i].position_m;
    renderer_.step(scene_, state_, now_ += kTickPeriod, kTickPeriod, rendering_);
  }
  const realtime::Rendering& rendering() const noexcept { return rendering_; }

 private:
  const scene::SceneSnapshot& scene_;
  const std::vector<HandTick>& hand_;
  realtime::Renderer renderer_;
  device::DeviceState state_;
  base::Nanos now_ = 0;
  realtime::Rendering rendering_;
};

// Read, render, guard, write, report and wake.
class WholeTurn final : public Stepper {
 public:
  WholeTurn(std::shared_ptr<const scene::SceneSnapshot> scene, const std::vector<HandTick>& hand)
      : hand_(hand), tick_(device_, clock_) {
    tick_.snapshots().publish(std::move(scene));
  }
  void step(std::size_t i) override {
    device_.position_m = hand_[i].position_m;
    tick_(now_ += kTickPeriod);
  }
  void after() override {
    tick_.reports().consume([](const realtime::TickReport&) {});
    tick_.wake().drain();
  }

 private:
  const std::vector<HandTick>& hand_;
  ToldDevice device_;
  base::MonotonicClock clock_;
  realtime::Tick tick_;
  base::Nanos now_ = 0;
};

class Bare final : public Stepper {
 public:
  Bare(const geometry::TriangleMesh& mesh, const std::vector<Segment>& segments)
      : index_(mesh, 1e-3F), segments_(segments) {}
  void step(std::size_t i) override {
    hits_ += index_.firstHit(segments_[i].from, segments_[i].to) <= 1 ? 1 : 0;
  }
  std::size_t hits() const noexcept { return hits_; }

 private:
  BareIndex index_;
  const std::vector<Segment>& segments_;
  std::size_t hits_ = 0;
};

// From the proxy to the hand, tick by tick: what any renderer has to ask its index.
std::vector<Segment> segmentsOf(const scene::SceneSnapshot& scene, const std::vector<HandTick>& hand) {
  std::vector<Segment> segments;
  Rendered recorded(scene, hand, 0);
  Vec3 proxy = hand.front().position_m;
  for (std::size_t i = 0; i < hand.size(); ++i) {
    segments.push_back({proxy.cast<float>(), hand[i].position_m.cast<float>()});
    recorded.step(i);
    proxy = recorded.rendering().proxy_m;
  }
  return segments;
}

struct Pair {
  std::map<Act, Samples> ours, bare;

  static Summary all(const std::map<Act, Samples>& by) {
    Samples together;
    for (const auto& [act, samples] : by) together.add(samples);
    return together.summary();
  }
};

enum class Regime { warm, loop, cold };

class Measurement {
 public:
  Measurement(const std::vector<HandTick>& hand, Stepper& bare) : hand_(hand), bare_(bare) {}

  Pair of(Stepper& ours, Regime regime, double seconds) {
    Pair pair;
    // The loop as the servo runs it, in a thread of the same rights.
    std::thread thread([&] {
      if (regime == Regime::loop) becomeRealtime();
      regime == Regime::warm ? warm(ours, seconds, pair) : spaced(ours, regime, seconds, pair);
    });
    thread.join();
    return pair;
  }

 private:
  void warm(Stepper& ours, double seconds, Pair& pair) {
    for (std::size_t i = 0; i < hand_.size(); ++i) ours.step(i), ours.after(), bare_.step(i);
    const std::int64_t end = nowNs() + static_cast<std::int64_t>(seconds * 1e9);
    while (nowNs() < end) {
      for (std::size_t at = 0; at < hand_.size(); at += kBlock) {
        const std::size_t stop = std::min(at + kBlock, hand_.size());
        for (std::size_t i = at; i < stop; ++i) measure(ours, i, pair.ours);
        for (std::size_t i = at; i < stop; ++i) measure(bare_, i, pair.bare);
      }
    }
  }

  void spaced(Stepper& ours, Regime regime, double seconds, Pair& pair) {
    const std::size_t stride = regime == Regime::cold ? strideFor(seconds) : 1;
    std::int64_t due = nowNs();
    const std::int64_t end = due + static_cast<std::int64_t>(seconds * 1e9);
    for (std::size_t i = 0; nowNs() < end; i = (i + 1) % hand_.size()) {
      if (i % stride != 0 || hand_[i].act == Act::way) {
        ours.step(i), ours.after();
        continue;
      }
      prepare(regime, due);
      measure(ours, i, pair.ours);
      prepare(regime, due);
      measure(bare_, i, pair.bare);
    }
  }

  // A few seconds must see all that the hand does: the way between is gone without measuring.
  std::size_t strideFor(double seconds) {
    const std::int64_t begin = nowNs();
    for (int i = 0; i < 4; ++i) evictor_.evict();
    const double pair_s = static_cast<double>(nowNs() - begin) * 1e-9 / 2;
    return static_cast<std::size_t>(static_cast<double>(hand_.size()) * pair_s / seconds) + 7;
  }

  void prepare(Regime regime, std::int64_t& due) {
    if (regime == Regime::cold) return evictor_.evict();
    sleepUntilNs(due += kTickPeriod / 2);
  }

  void measure(Stepper& stepper, std::size_t i, std::map<Act, Samples>& into) {
    if (hand_[i].act == Act::way) {
      stepper.step(i), stepper.after();
      return;
    }
    into[hand_[i].act].add(clock_.timeUs([&] { stepper.step(i); }));
    stepper.after();
  }

  const std::vector<HandTick>& hand_;
  Stepper& bare_;
  Evictor evictor_;
  const FineClock clock_;
};

const char* nameOf(Regime regime) {
  return regime == Regime::warm ? "warm" : regime == Regime::loop ? "1 kHz loop" : "cold";
}

enum class What { point, finger, turn };

void addChecks(Row& row, Regime regime, What what) {
  const bool warm = regime == Regime::warm;
  if (regime == Regime::loop || what == What::turn) return;
  const bool point = what == What::point;
  if (point) row.checks.push_back({"p50 ratio", row.ratio(), warm ? 5.0 : 2.5});
  row.checks.push_back({"p99", row.ours.p99, point ? (warm ? 3.0 : 20.0) : (warm ? 20.0 : 100.0)});
}

class TickBench {
 public:
  explicit TickBench(const Run& run) : run_(run), hand_(handOf(2)) {}

  Outcome measure() {
    for (const std::size_t triangles : {1'000, 10'000, 100'000, 1'000'000}) ofSize(triangles);
    return std::move(outcome_);
  }

 private:
  void ofSize(std::size_t triangles) {
    run_.progress(std::to_string(triangles) + " triangles");
    million_ = triangles == 1'000'000;
    const geometry::TriangleMesh& mesh = bumpyBall(triangles);
    const auto scene = sceneOf(mesh);
    const std::vector<Segment> segments = segmentsOf(*scene, hand_);
    Bare bare(mesh, segments);
    Measurement measurement(hand_, bare);
    const std::string size = million_ ? "1M" : std::to_string(triangles / 1000) + "k";
    for (const Regime regime : {Regime::warm, Regime::loop, Regime::cold}) {
      const double seconds = run_.seconds(regime == Regime::warm ? 1.5 : 3, 6, 20);
      Rendered point(*scene, hand_, 0);
      add(measurement.of(point, regime, seconds), size + ", point, ", regime, What::point);
      if (regime != Regime::loop) {
        Rendered ball(*scene, hand_, 0.001);
        add(measurement.of(ball, regime, seconds), size + ", 1 mm finger, ", regime, What::finger);
      }
      if (!million_) continue;
      WholeTurn turn(scene, hand_);
      add(measurement.of(turn, regime, seconds), size + ", whole turn with guard, report and wake, ", regime,
          What::turn);
    }
  }

  void add(const Pair& pair, const std::string& what, Regime regime, What kind) {
    Row row{what + nameOf(regime), "us", Pair::all(pair.ours), Pair::all(pair.bare), {}, {}};
    if (million_) addChecks(row, regime, kind);
    outcome_.rows.push_back(row);
    if (!million_ || kind != What::point) return;
    for (const Act act : kActs) {
      if (pair.ours.count(act) == 0) continue;
      outcome_.rows.push_back({"- " + what + nameOf(regime) + ", " + bench::nameOf(act),
                               "us",
                               pair.ours.at(act).summary(),
                               pair.bare.at(act).summary(),
                               {},
                               {}});
    }
  }

  const Run& run_;
  const std::vector<HandTick> hand_;
  bool million_ = false;
  Outcome outcome_;
};

}  // namespace

Outcome measureTick(const Run& run) {
  return TickBench(run).measure();
}

}  // namespace hapticd::bench
