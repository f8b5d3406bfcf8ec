// Files with the path of a simulated hand: each is read, or refused with a reason.
#include <cmath>

#include "device/simulated/hand_file.h"
#include "fuzz/targets.h"

namespace hapticd::fuzz {
namespace {

bool mayBeAdded(base::Nanos t) {
  return t > -(INT64_MAX / 4) && t < INT64_MAX / 4;
}

}  // namespace

void hand_csv(Input input) {
  try {
    const auto hand = device::HandFile::parse(textOf(input), "hand.csv");
    require(hand->rows() > 0, "a hand has rows");
    require(mayBeAdded(hand->begin()) && mayBeAdded(hand->duration()), "times may be added");
    for (const base::Nanos t :
         {hand->begin() - 1, hand->begin(), (hand->begin() + hand->duration()) / 2, hand->duration(),
          hand->duration() + 1, base::Nanos{0}, base::Nanos{1'500'000}}) {
      const device::HandPose pose = hand->at(t);
      require(pose.position_m.allFinite(), "positions are finite");
      require(std::abs(pose.orientation.norm() - 1) < 1e-6, "orientations are rotations");
    }
  } catch (const device::HandFileError& error) {
    require(std::string_view(error.what()).starts_with("hand.csv") ||
                std::string_view(error.what()).find("hand.csv") != std::string_view::npos,
            "an error names the file");
  }
}

}  // namespace hapticd::fuzz
