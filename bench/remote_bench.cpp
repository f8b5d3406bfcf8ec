// How stiff a wall may be that a client renders across a network, and what streamed contacts cost the servo.
#include <cmath>
#include <string>

#include "bench/all.h"
#include "bench/remote_loop.h"
#include "bench/timing.h"
#include "realtime/remote/remote_contacts.h"

namespace hapticd::bench {
namespace {

using geometry::Vec3;

struct Line {
  const char* what;
  double rate_Hz;
  double jitter_s;
  double delay_s;
  double loss;
};

constexpr Line kLines[] = {
    {"60 Hz +- 5 ms, 20 ms each way, 1 % lost", 60, 0.005, 0.020, 0.01},
    {"60 Hz, 5 ms each way", 60, 0, 0.005, 0},
    {"200 Hz, 20 ms each way", 200, 0, 0.020, 0},
    {"200 Hz, 5 ms each way", 200, 0, 0.005, 0},
    {"1000 Hz, 1 ms each way", 1000, 0, 0.001, 0},
    {"1000 Hz, same machine", 1000, 0, 0, 0},
};

double stiffest(const Line& line, double damping, WallBy by) {
  RemoteLoop loop;
  loop.by = by;
  loop.rate_Hz = line.rate_Hz;
  loop.jitter_s = line.jitter_s;
  loop.delay_s = line.delay_s;
  loop.loss = line.loss;
  loop.handDamping_Ns_per_m = damping;
  return stiffestWall(loop);
}

Row wallRow(const Line& line, double damping) {
  const double remote = stiffest(line, damping, WallBy::remoteContact);
  Row row{std::string(line.what) + ", b = " + std::to_string(std::lround(damping)) + " N s/m",
          "N/m",
          Summary::of(remote),
          Summary::of(stiffest(line, damping, WallBy::local)),
          {},
          "held force: " + std::to_string(std::lround(stiffest(line, damping, WallBy::heldForce))) + " N/m"};
  if (line.loss > 0) row.checks.push_back({"stiffest wall", remote, 1000, true});
  return row;
}

// A hand that moves by a millimetre between 16 surfaces around it, `touched` of which it is below.
class Cost {
 public:
  Cost(int contacts, int touched, bool turning) {
    set_.count = static_cast<std::uint32_t>(contacts);
    for (int i = 0; i < contacts; ++i) {
      realtime::RemoteContact& c = set_.contacts[static_cast<std::size_t>(i)];
      const double angle = 0.35 * i;
      c.id = i;
      c.shape = static_cast<realtime::RemoteShape>(i % 3);
      c.radius_m = 0.030;
      c.normal = Vec3(std::sin(angle), std::cos(angle), 0);
      c.point_m = (i < touched ? 0.002 : -0.005) * c.normal;
      c.axis = Vec3::UnitZ();
      c.velocity_m_per_s = {0.01, 0, 0};
      if (turning) c.angularVelocity_rad_per_s = {0, 0, 0.5};
      c.stiffness_N_per_m = 500;
      c.damping_Ns_per_m = 1;
      c.staticFriction = 0.4;
      c.dynamicFriction = 0.3;
      c.yields = true;
    }
  }

  Samples measure(double seconds) {
    Samples samples;
    const FineClock clock;
    const std::int64_t end = nowNs() + static_cast<std::int64_t>(seconds * 1e9);
    while (nowNs() < end) {
      for (int block = 0; block < 250; ++block) {
        now_ += 1'000'000;
        if (now_ % 16'000'000 == 0) {
          ++set_.number;
          set_.received = set_.stated = now_;
        }
        hand_.position_m.x() = 0.0005 * std::sin(1e-9 * static_cast<double>(now_));
        out_.count = 0;
        samples.add(clock.timeUs([&] { law_.step(set_, hand_, now_, 1e-3, out_); }));
      }
    }
    return samples;
  }

 private:
  realtime::RemoteContacts law_;
  realtime::RemoteContactSet set_;
  realtime::RemoteHand hand_;
  realtime::RemoteRendering out_;
  base::Nanos now_ = 0;
};

}  // namespace

Outcome measureRemote(const Run& run) {
  Outcome outcome;
  for (const double damping : {1.0, 5.0}) {
    for (const Line& line : kLines) {
      run.progress(line.what);
      outcome.rows.push_back(wallRow(line, damping));
    }
  }
  const double seconds = run.seconds(0.5, 2, 5);
  const Summary none = Cost(0, 0, false).measure(seconds).summary();
  Row sixteen{"tick, 16 contacts around the hand, 3 touched",
              "us",
              Cost(16, 3, false).measure(seconds).summary(),
              none,
              {},
              {}};
  sixteen.checks.push_back({"p50", sixteen.ours.p50, 1.0});
  outcome.rows.push_back(std::move(sixteen));
  outcome.rows.push_back({"tick, 16 turning contacts, all touched",
                          "us",
                          Cost(16, 16, true).measure(seconds).summary(),
                          none,
                          {},
                          {}});
  return outcome;
}

}  // namespace hapticd::bench
