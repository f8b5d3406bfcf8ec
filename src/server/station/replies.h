// Replies to queries about a device, as pure functions of configuration, profile and tick.
#pragma once

#include "device/device.h"
#include "server/reports/outbox.h"
#include "wire/messages.h"

namespace hapticd::server {

/// The configured workspace of the device, by default that of its profile. Metres, device frame.
geometry::Box workspaceOf(const DeviceConfig& config, const device::DeviceProfile& profile);

/// The bounding box of the workspace in the world at this tick, in reported metres.
wire::TrackerWorkspace trackerWorkspace(const geometry::Box& workspace_m, const realtime::TickReport& tick);

/// The frame of reported poses in VRPN's room, which is the world in reported metres.
wire::TrackerToRoom trackerToRoom(const ReportFrame& frame);

/// Extensions, rates, peak force and workspace of the device.
wire::Capabilities capabilities(const DeviceConfig& config, const device::DeviceProfile& profile,
                                bool takesInput, bool canBeHeld);

}  // namespace hapticd::server
