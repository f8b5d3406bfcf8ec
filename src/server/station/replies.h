// Questions about a device that need no scene: each is a pure function of what is known.
#pragma once

#include "device/device.h"
#include "server/reports/outbox.h"
#include "wire/messages.h"

namespace hapticd::server {

/// The box the device works in: its own, the paper's, or six numbers, as configured. Metres, device frame.
geometry::Box workspaceOf(const DeviceConfig& config, const device::DeviceProfile& profile);

/// The workspace in reported metres, as it lies in the world at this tick.
wire::TrackerWorkspace trackerWorkspace(const geometry::Box& workspace_m, const realtime::TickReport& tick);

/// The frame of reported poses in the room, which is the world over 1000.
wire::TrackerToRoom trackerToRoom(const ReportFrame& frame);

wire::Capabilities capabilities(const DeviceConfig& config, const device::DeviceProfile& profile,
                                bool canBeHeld);

}  // namespace hapticd::server
