// What can be done to a hand that no person moves.
#pragma once

#include <memory>

#include "device/simulated/hand_path.h"

namespace hapticd::device {

/// The optional side of a Device whose hand follows commands, see Device::steered(). One thread at a time,
/// not the servo's.
class SteeredHand {
 public:
  /// The hand moves to the start of the path at the next read() and then follows it. Null: it rests. Paths
  /// are freed in the calling thread.
  virtual void setPath(std::shared_ptr<const HandPath> path) = 0;
  /// The hand moves to this pose and stays there until the next call; the path waits. Wait-free.
  virtual void setTarget(const HandPose& pose) noexcept = 0;
  /// The hand returns to its path.
  virtual void releaseTarget() noexcept = 0;

 protected:
  ~SteeredHand() = default;
};

}  // namespace hapticd::device
