// Files with the path of a simulated hand: each is read, or refused with a reason.
#include <cmath>

#include "device/simulated/hand_file.h"
#include "fuzz/targets.h"

namespace hapticd::fuzz {
namespace {

bool mayBeAdded(base::Nanos t) {
  return t > -(INT64_MAX / 4) && t < INT64_MAX / 4;
}

void requireUsable(const device::HandFile& hand) {
  require(hand.rows() > 0, "a hand has rows");
  require(mayBeAdded(hand.begin()) && mayBeAdded(hand.duration()), "times may be added");
  for (const base::Nanos t : {hand.begin() - 1, hand.begin(), (hand.begin() + hand.duration()) / 2,
                              hand.duration(), hand.duration() + 1, base::Nanos{0}, base::Nanos{1'500'000}}) {
    const device::HandPose pose = hand.at(t);
    require(pose.position_m.allFinite(), "positions are finite");
    require(std::abs(pose.orientation.norm() - 1) < 1e-6, "orientations are rotations");
  }
}

void requireName(const device::HandFileError& error, std::string_view name) {
  require(std::string_view(error.what()).find(name) != std::string_view::npos, "an error names the file");
}

}  // namespace

void hand_csv(Input input) {
  try {
    requireUsable(*device::HandFile::parse(textOf(input), "hand.csv"));
  } catch (const device::HandFileError& error) {
    requireName(error, "hand.csv");
  }
}

void hand_traj(Input input) {
  device::TrajectoryFormat format;
  if (selector(input) == '!') {  // no sample begins so
    format = {.columns = device::TrajectoryColumns::parse("-,fz,fy,fx,z,y,x,t"),
              .unit_m = 1,
              .unit_s = 1e-3,
              .forceOnSurface = true};
    input = input.subspan(1);
  }
  try {
    const device::Trajectory read = device::Trajectory::parse(textOf(input), "probe.traj", format);
    const device::TrajectorySample* before = nullptr;
    for (const device::TrajectorySample& sample : read.samples) {
      require(sample.position_m.allFinite() && sample.force_N.allFinite(), "samples are finite");
      require(before == nullptr || before->time < sample.time, "time goes forwards");
      before = &sample;
    }
    requireUsable(*device::HandFile::of(read));
  } catch (const device::HandFileError& error) {
    requireName(error, "probe.traj");
  }
}

}  // namespace hapticd::fuzz
