#include <algorithm>
#include <cstdio>
#include <iterator>

#include "sim/simulation.h"

namespace hapticd::sim {

const char* nameOf(Action::Kind kind) {
  static constexpr const char* kNames[] = {"stop",      "rearm",         "move",     "batch",    "upload",
                                           "appear",    "vanish",        "pause",    "nonsense", "flood",
                                           "wall step", "disk fails",    "describe", "stream",   "visit",
                                           "no memory", "no descriptors"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(Action::Kind::noDescriptors) + 1);
  return kNames[static_cast<int>(kind)];
}

Script drawScript(std::uint64_t seed, double seconds) {
  Dice dice(seed);
  Script script;
  script.seed = seed;
  script.length = base::toNanos(seconds);
  script.cube = dice.chance(0.7);
  script.record = dice.chance(0.3);
  script.networkDelay = dice.between(Nanos{20'000}, Nanos{2'000'000});
  script.networkJitter = dice.chance(0.5) ? dice.between(Nanos{0}, Nanos{10'000'000}) : 0;
  script.window = std::size_t{16 * 1024} << dice.below(6);

  // Some runs are calm in one respect, so that what hides behind a fault shows, too.
  const auto sometimes = [&](double share, double most) {
    return dice.chance(share) ? dice.unit() * most : 0;
  };
  script.adversity.preempt = sometimes(0.7, 0.05);
  script.adversity.lateTick = sometimes(0.5, 0.003);
  script.adversity.netStall = sometimes(0.4, 0.0005);
  script.adversity.sceneStall = sometimes(0.4, 0.02);
  script.adversity.longestSceneStall = dice.chance(0.3) ? 6'000'000'000 : 300'000'000;
  script.adversity.freeze = sometimes(0.3, 0.0003);
  script.adversity.suspend = dice.chance(0.3) ? 0.3 : 0;
  DeviceFaults& f = script.faults;
  for (double* p : {&f.noState, &f.notFinite, &f.hold, &f.fault, &f.leap, &f.refuse, &f.hang, &f.lost})
    *p = sometimes(0.3, 0.0006);

  using Kind = Action::Kind;
  const auto every = [&](Kind kind, double mean_s) {
    for (double t = dice.uniform(0.0, 2 * mean_s); t < seconds; t += dice.uniform(0.02, 2 * mean_s))
      script.actions.push_back({base::toNanos(t), kind, dice.below(~std::uint64_t{0})});
  };
  every(Kind::stop, dice.uniform(1.0, 8.0));
  every(Kind::rearm, dice.uniform(0.3, 1.5));
  if (script.cube) every(Kind::move, dice.uniform(1.0, 3.0));
  every(Kind::batch, dice.uniform(0.05, 1.0));
  if (dice.chance(0.5)) every(Kind::upload, dice.uniform(1.0, 5.0));
  if (!script.cube || dice.chance(0.5)) {
    every(Kind::appear, dice.uniform(0.5, 2.0));
    every(Kind::vanish, dice.uniform(0.5, 2.0));
  }
  if (dice.chance(0.4)) every(Kind::pauseRead, 4.0);
  if (dice.chance(0.4)) every(Kind::nonsense, 0.5);
  if (dice.chance(0.3)) every(Kind::flood, 2.0);
  if (dice.chance(0.3)) every(Kind::wallStep, 5.0);
  if (script.record && dice.chance(0.3)) every(Kind::diskFails, 8.0);
  every(Kind::describe, 2.0);
  if (!script.record && dice.chance(0.3)) every(Kind::diskFails, 8.0);  // black boxes are written as well
  if (dice.chance(0.4)) {
    every(Kind::stream, dice.uniform(1.0, 4.0));
    // Where nobody else pushes, each end of a stream is an end of force.
    if (dice.chance(0.5))
      std::erase_if(script.actions,
                    [](const Action& a) { return a.kind == Kind::appear || a.kind == Kind::vanish; });
  }
  script.web = dice.chance(0.5);
  if (script.web) every(Kind::visit, dice.uniform(0.2, 3.0));
  script.datagrams = dice.chance(0.5);
  if (dice.chance(0.3)) every(Kind::noMemory, 5.0);
  if (dice.chance(0.3)) every(Kind::noDescriptors, 5.0);
  script.local = dice.chance(0.5);
  script.ownLoop = dice.chance(0.3);
  std::stable_sort(script.actions.begin(), script.actions.end(),
                   [](const Action& a, const Action& b) { return a.at < b.at; });
  return script;
}

std::string describe(const Script& script) {
  std::string text;
  const auto line = [&](const char* name, double value) {
    char number[96];
    std::snprintf(number, sizeof number, "  %-20s %.6g\n", name, value);
    if (value != 0) text += number;
  };
  line("seconds", base::toSeconds(script.length));
  line("cube", script.cube);
  line("record", script.record);
  line("web", script.web);
  line("datagrams", script.datagrams);
  line("local", script.local);
  line("own loop", script.ownLoop);
  line("delay, ms", static_cast<double>(script.networkDelay) * 1e-6);
  line("jitter, ms", static_cast<double>(script.networkJitter) * 1e-6);
  line("window, bytes", static_cast<double>(script.window));
  line("preempt", script.adversity.preempt);
  line("late tick", script.adversity.lateTick);
  line("net stall", script.adversity.netStall);
  line("scene stall", script.adversity.sceneStall);
  line("freeze", script.adversity.freeze);
  line("no state", script.faults.noState);
  line("not finite", script.faults.notFinite);
  line("hold", script.faults.hold);
  line("fault", script.faults.fault);
  line("leap", script.faults.leap);
  line("refuse", script.faults.refuse);
  line("hang", script.faults.hang);
  line("lost", script.faults.lost);
  for (const Action& action : script.actions) {
    char number[96];
    std::snprintf(number, sizeof number, "  %10.6f s %s\n", base::toSeconds(action.at), nameOf(action.kind));
    text += number;
  }
  return text;
}

}  // namespace hapticd::sim
