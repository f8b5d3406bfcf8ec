// A recorded hand as a device: its position follows the recording, whatever the force.
#pragma once

#include <filesystem>
#include <memory>

#include "device/device.h"
#include "device/profiles.h"
#include "device/simulated/hand_file.h"

namespace hapticd::device {

struct ReplayOptions {
  std::filesystem::path file;  ///< t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons]
  bool repeat = false;         ///< repeat from the beginning instead of resting at the end
  DeviceProfile profile = profiles().front();
};

/// The recording starts with the first read() after open().
class ReplayDevice final : public Device {
 public:
  explicit ReplayDevice(ReplayOptions options) : options_(std::move(options)) {}

  /// Reads the file. Throws HandFileError.
  void open() override;
  void close() noexcept override {}
  const DeviceProfile& profile() const noexcept override { return options_.profile; }

  bool read(Nanos now, DeviceState& state) noexcept override;
  bool write(const Vec3& force_N) noexcept override;

 private:
  const ReplayOptions options_;
  std::shared_ptr<const HandFile> hand_;

  // Servo thread only.
  bool started_ = false;
  Nanos start_ = 0;
  Nanos last_ = 0;
  Quat orientation_ = Quat::Identity();
};

}  // namespace hapticd::device
