// Every key of the configuration, named once, for the reader and the writer of files.
#pragma once

#include <array>
#include <utility>

#include "device/drivers/drivers.h"
#include "server/config/config.h"

namespace hapticd::server {

template <class Enum, std::size_t N>
using Choices = std::array<std::pair<const char*, Enum>, N>;

inline constexpr Choices<MaterialScale, 2> kMaterialScales{
    {{"reference", MaterialScale::reference}, {"device", MaterialScale::device}}};
inline constexpr Choices<QuaternionOrder, 2> kQuaternionOrders{
    {{"xyzw", QuaternionOrder::xyzw}, {"wxyz", QuaternionOrder::wxyz}}};
inline constexpr Choices<ForceReport, 2> kForceReports{
    {{"total", ForceReport::total}, {"normal", ForceReport::normal}}};
inline constexpr Choices<WorkspaceFit, 2> kWorkspaceFits{
    {{"published", WorkspaceFit::published}, {"enclose", WorkspaceFit::enclose}}};
inline constexpr Choices<VibrationUnit, 2> kVibrationUnits{
    {{"rad/s", VibrationUnit::radPerSecond}, {"Hz", VibrationUnit::hertz}}};
inline constexpr Choices<VibrationFrame, 2> kVibrationFrames{
    {{"stylus", VibrationFrame::stylus}, {"device", VibrationFrame::device}}};
inline constexpr Choices<SceneOnDisconnect, 2> kSceneOnDisconnects{
    {{"keep", SceneOnDisconnect::keep}, {"clear", SceneOnDisconnect::clear}}};
inline constexpr Choices<Control, 3> kControls{
    {{"any", Control::any}, {"first", Control::first}, {"list", Control::list}}};

/// Calls `visitor` for each key of a [[device]] with the corresponding field. `Device` may be const.
template <class Visitor, class Device>
void visitFields(Visitor& visitor, Device& device) requires requires {
  device.names;
}
{
  visitor.names("names", device.names);
  visitor.field("driver", device.driver);
  visitor.field("hardware", device.hardware);
  for (const std::string& key : device::driverKeys()) visitor.driverKey(key, device.driverKeys);
  visitor.field("calibrate", device.calibrate);
  visitor.field("enable_forces", device.enableForces);
  visitor.field("isolate", device.isolate);
  visitor.field("isolate_watch", device.isolateWatch);
  visitor.field("hand", device.hand);
  visitor.field("servo_rate_Hz", device.servoRate_Hz);
  visitor.field("report_rate_Hz", device.reportRate_Hz);
  visitor.milli("linear_tolerance_mm", device.linearTolerance_m);
  visitor.field("angular_tolerance_rad", device.angularTolerance_rad);
  visitor.milli("tool_radius_mm", device.toolRadius_m);
  visitor.workspace("workspace", device.workspace_mm);
  visitor.field("force_shading", device.forceShading);
  visitor.milli("stribeck_speed_mm_per_s", device.stribeckSpeed_m_per_s);
  visitor.milli("held_force_power_mW", device.heldForcePower_W);
  visitor.choice("material_scale", device.materialScale, kMaterialScales);
  visitor.choice("quaternion_order", device.quaternionOrder, kQuaternionOrders);
  visitor.choice("force_report", device.forceReport, kForceReports);
  visitor.choice("workspace_fit", device.workspaceFit, kWorkspaceFits);
  visitor.choice("vibration_contact_unit", device.vibrationContactUnit, kVibrationUnits);
  visitor.field("vibration_contact_pulls", device.vibrationContactPulls);
  visitor.choice("vibration_motor_frame", device.vibrationMotorFrame, kVibrationFrames);
  visitor.field("mirrors", device.mirrors);
  visitor.field("compat_mirrors", device.compatMirrors);
  visitor.field("scene", device.scene);
  visitor.choice("scene_on_disconnect", device.sceneOnDisconnect, kSceneOnDisconnects);
  visitor.choice("control", device.control, kControls);
  visitor.field("control_list", device.controlList);
  visitor.field("black_box_dir", device.blackBoxDir);
  visitor.field("black_box_keep", device.blackBoxKeep);
}

/// The same for the keys of [compat].
template <class Visitor, class Compat>
void visitFields(Visitor& visitor, Compat& compat) requires requires {
  compat.haply;
}
{
  visitor.field("haply", compat.haply);
  visitor.milli("haply_hold_ms", compat.haplyHold_s);
  visitor.field("haply_origins", compat.haplyOrigins);
}

/// The same for the keys of [limits].
template <class Visitor, class Limits>
void visitFields(Visitor& visitor, Limits& limits) requires requires {
  limits.connections;
}
{
  visitor.field("connections", limits.connections);
  visitor.field("connections_per_address", limits.connectionsPerAddress);
  visitor.field("connections_unfinished", limits.unfinishedConnections);
  visitor.field("memory_MB", limits.memory_MB);
  visitor.field("client_memory_MB", limits.clientMemory_MB);
  visitor.field("send_queue_MB", limits.sendQueue_MB);
  visitor.field("batches_MB", limits.batches_MB);
  visitor.field("objects", limits.objects);
  visitor.field("vertices", limits.vertices);
  visitor.field("triangles", limits.triangles);
  visitor.field("effects", limits.effects);
  visitor.field("commands_per_second", limits.commandsPerSecond);
  visitor.field("recording_MB", limits.recording_MB);
  visitor.field("black_boxes_MB", limits.blackBoxes_MB);
  visitor.field("log_kB_per_second", limits.log_kB_per_s);
}

/// The same for the keys of the server itself, without its devices, [compat] and [limits].
template <class Visitor, class Server>
void visitFields(Visitor& visitor, Server& server) requires requires {
  server.devices;
}
{
  visitor.listen("listen", server.listenAddress, server.port);
  visitor.field("allow_no_rt", server.allowNoRealtime);
  visitor.field("seconds", server.seconds);
  visitor.field("callback_hosts", server.callbackHosts);
  visitor.field("record", server.record);
  visitor.field("http", server.http);
  visitor.field("http_allow", server.httpAllow);
  visitor.field("announce", server.announce);
  visitor.field("socket", server.socket);
  visitor.field("tokens", server.tokens);
  visitor.field("owner_users", server.ownerUsers);
  visitor.field("operator_users", server.operatorUsers);
  visitor.field("trusted_networks", server.trustedNetworks);
  visitor.field("tls", server.tls);
  visitor.field("tls_key", server.tlsKey);
  visitor.field("tls_loopback", server.tlsLoopback);
  visitor.field("insecure", server.insecure);
}

}  // namespace hapticd::server
