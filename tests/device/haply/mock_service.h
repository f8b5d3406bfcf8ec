// The Inverse Service as a small WebSocket server on a free port of this machine, with one Inverse3 and a
// grip.
#pragma once

#include <memory>
#include <string>

#include "geometry/types.h"
#include "mocks/arm_block.h"

namespace hapticd::device {

using geometry::Vec3;

/// All functions may be called from any thread. Vectors are in the service's frame: x right, y away, z up.
class MockService {
 public:
  MockService();
  ~MockService();
  MockService(const MockService&) = delete;
  MockService& operator=(const MockService&) = delete;

  std::string port() const;
  void hand(const Vec3& position_m, const Vec3& velocity_m_per_s = Vec3::Zero());
  /// The force on the device: of the last message, and zero without a connection, as the service frees the
  /// device.
  Vec3 force() const;
  int messages() const;
  int connections() const;

  void button(bool pressed);
  void status(const std::string& json);
  void basis(const std::string& permutation);
  void withoutDevice(bool yes);
  /// Another Inverse3, "MOCK2", is listed before "MOCK1"; force() is that on "MOCK1" still.
  void another(bool yes);
  /// Messages with a command for "MOCK2".
  int toAnother() const;
  /// Takes messages and does not answer.
  void mute(bool yes);
  /// Answers with something that is not JSON.
  void babble(bool yes);
  /// Closes the present connection.
  void hangUp();
  /// Closes every connection at once after accepting it.
  void refuse(bool yes);
  /// From the next connection on the hand goes where the block says, one place with each message, and each
  /// force is logged there with the place that the message before had told.
  void follow(mock::ArmBlock& block);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd::device
