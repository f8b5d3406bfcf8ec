// The fields of everything in a recording except scene commands, which describe themselves
// (scene/command_info.h). Structured bindings count the members: a new one does not compile until it is
// listed, and then kFormatVersion must increase.
#pragma once

#include <concepts>

#include "record/recording.h"

namespace hapticd::record {

template <class C, class T>
concept Is = std::same_as<std::remove_const_t<C>, T>;

template <Is<geometry::Box> T, class V>
void fields(T& box, V&& v) {
  auto& [min, max] = box;
  v("min", min);
  v("max", max);
}

template <Is<scene::SceneLimits> T, class V>
void fields(T& limits, V&& v) {
  auto& [objects, nesting, verticesPerObject, trianglesPerObject, verticesInAll, trianglesInAll, effects,
         batch_bytes] = limits;
  v("objects", objects);
  v("nesting", nesting);
  v("vertices_per_object", verticesPerObject);
  v("triangles_per_object", trianglesPerObject);
  v("vertices_in_all", verticesInAll);
  v("triangles_in_all", trianglesInAll);
  v("effects", effects);
  v("batch_bytes", batch_bytes);
}

template <Is<scene::SceneConfig> T, class V>
void fields(T& config, V&& v) {
  auto& [materialScale, workspaceFit, contactVibrationUnit, motorVibrationFrame, deviceWorkspace_m,
         nominalStiffness_N_per_m, nominalForce_N, ownDamping_Ns_per_m, servoPeriod_s, transportDelay_s, raw,
         checkMeshes, limits, ballTool, stopwatch, clock, owners] = config;
  v("material_scale", materialScale);
  v("workspace_fit", workspaceFit);
  v("contact_vibration_unit", contactVibrationUnit);
  v("motor_vibration_frame", motorVibrationFrame);
  v("device_workspace_m", deviceWorkspace_m);
  v("nominal_stiffness_N_per_m", nominalStiffness_N_per_m);
  v("nominal_force_N", nominalForce_N);
  v("own_damping_Ns_per_m", ownDamping_Ns_per_m);
  v("servo_period_s", servoPeriod_s);
  v("transport_delay_s", transportDelay_s);
  v("raw", raw);
  v("check_meshes", checkMeshes);
  v("limits", limits);
  static_cast<void>(ballTool);
  static_cast<void>(stopwatch);  // its readings are in the publish events
  static_cast<void>(clock);      // and so are these
  static_cast<void>(owners);
}

template <Is<realtime::RenderOptions> T, class V>
void fields(T& options, V&& v) {
  auto& [toolRadius_m, forceShading, stribeckSpeed_m_per_s, contactVibrationPulls, contactRise_N_per_s,
         bareDamping_Ns_per_m] = options;
  v("tool_radius_m", toolRadius_m);
  v("force_shading", forceShading);
  static_cast<void>(stribeckSpeed_m_per_s);  // in the block of the law
  static_cast<void>(contactVibrationPulls);
  static_cast<void>(contactRise_N_per_s);   // the guard's
  static_cast<void>(bareDamping_Ns_per_m);  // in a block of its own
}

template <Is<LawOptions> T, class V>
void fields(T& options, V&& v) {
  auto& [stribeckSpeed_m_per_s, contactVibrationPulls] = options;
  v("stribeck_speed_m_per_s", stribeckSpeed_m_per_s);
  v("contact_vibration_pulls", contactVibrationPulls);
}

template <Is<PassivityRecord> T, class V>
void fields(T& record, V&& v) {
  auto& [bareDamping_Ns_per_m] = record;
  v("bare_damping_Ns_per_m", bareDamping_Ns_per_m);
}

template <Is<LawRecord> T, class V>
void fields(T& law, V&& v) {
  auto& [number, devices] = law;
  v("number", number);
  v("devices", devices);
}

template <Is<realtime::GuardOptions> T, class V>
void fields(T& options, V&& v) {
  auto& [enabled, selfRecover, armed, peakForce_N, continuousForce_N, slew_N_per_s, speed_m_per_s, speedTicks,
         calmSpeed_m_per_s, rampIn, late, lateDecay, stalled, blend] = options;
  v("enabled", enabled);
  v("self_recover", selfRecover);
  v("armed", armed);
  v("peak_force_N", peakForce_N);
  v("continuous_force_N", continuousForce_N);
  v("slew_N_per_s", slew_N_per_s);
  v("speed_m_per_s", speed_m_per_s);
  v("speed_ticks", speedTicks);
  v("calm_speed_m_per_s", calmSpeed_m_per_s);
  v("ramp_in_ns", rampIn);
  v("late_ns", late);
  v("late_decay_ns", lateDecay);
  v("stalled_ns", stalled);
  v("blend_ns", blend);
}

template <Is<realtime::TickOptions> T, class V>
void fields(T& options, V&& v) {
  auto& [rate_Hz, render, guard, reports, blackBox_s, forceLife] = options;
  v("rate_Hz", rate_Hz);
  v("render", render);
  v("guard", guard);
  static_cast<void>(reports);  // sizes of memory
  static_cast<void>(blackBox_s);
  static_cast<void>(forceLife);  // each tick that it concerned says so
}

template <Is<RecordedDevice> T, class V>
void fields(T& device, V&& v) {
  auto& [names, driver, model, buttons, scene, sceneConfig, tick] = device;
  v("names", names);
  v("driver", driver);
  v("model", model);
  v("buttons", buttons);
  v("scene", scene);
  v("scene_config", sceneConfig);
  v("tick", tick);
}

template <Is<RecordingHeader> T, class V>
void fields(T& header, V&& v) {
  auto& [program, wallOffset, config, devices, law] = header;
  v("program", program);
  v("wall_offset_ns", wallOffset);
  v("config", config);
  v("devices", devices);
  static_cast<void>(law);  // a block of its own, so that old readers skip it
}

template <Is<PublishEvent> T, class V>
void fields(T& event, V&& v) {
  auto& [device, time, revision, stopwatch] = event;
  v("device", device);
  v("time_ns", time);
  v("revision", revision);
  v("stopwatch_ns", stopwatch);
}

template <Is<LostEvent> T, class V>
void fields(T& event, V&& v) {
  auto& [what, device, count] = event;
  v("what", what);
  v("device", device);
  v("count", count);
}

template <Is<MarkerEvent> T, class V>
void fields(T& event, V&& v) {
  auto& [time, text] = event;
  v("time_ns", time);
  v("text", text);
}

template <Is<WallOffsetRecord> T, class V>
void fields(T& record, V&& v) {
  auto& [time, offset] = record;
  v("time_ns", time);
  v("offset_ns", offset);
}

template <Is<EndEvent> T, class V>
void fields(T& event, V&& v) {
  auto& [time] = event;
  v("time_ns", time);
}

/// Without the opening of the gripper, which few devices have.
template <Is<device::DeviceState> T, class V>
void fields(T& state, V&& v) {
  auto& [time, position_m, orientation, velocity_m_per_s, angularVelocity_rad_per_s, buttons, hold,
         motorTemperature, gripper_rad] = state;
  v("time_ns", time);
  v("position_m", position_m);
  v("orientation", orientation);
  v("velocity_m_per_s", velocity_m_per_s);
  v("angular_velocity_rad_per_s", angularVelocity_rad_per_s);
  v("buttons", buttons);
  v("hold", hold);
  v("motor_temperature", motorTemperature);
  static_cast<void>(gripper_rad);  // only in ticks that have one
}

template <Is<realtime::Contact> T, class V>
void fields(T& contact, V&& v) {
  auto& [object, triangle, point_m, normal, force_N] = contact;
  v("object", object);
  v("triangle", triangle);
  v("point_m", point_m);
  v("normal", normal);
  v("force_N", force_N);
}

/// Without the contacts, of which there are contactCount.
template <Is<realtime::Rendering> T, class V>
void fields(T& rendering, V&& v) {
  auto& [proxy_m, force_N, contactForce_N, normalForce_N, touching, touchedObject, depth_m, normal, scp_m,
         contactCount, contacts, status] = rendering;
  v("proxy_m", proxy_m);
  v("force_N", force_N);
  v("contact_force_N", contactForce_N);
  v("normal_force_N", normalForce_N);
  v("touching", touching);
  v("touched_object", touchedObject);
  v("depth_m", depth_m);
  v("normal", normal);
  v("scp_m", scp_m);
  v("contact_count", contactCount);
  v("status", status);
  static_cast<void>(contacts);
}

template <Is<realtime::TickTiming> T, class V>
void fields(T& timing, V&& v) {
  auto& [period, wakeupError, compute, overruns, skippedPeriods] = timing;
  v("period_ns", period);
  v("wakeup_error_ns", wakeupError);
  v("compute_ns", compute);
  v("overruns", overruns);
  v("skipped_periods", skippedPeriods);
}

/// Without the counts, which are written when they change.
template <Is<realtime::GuardReport> T, class V>
void fields(T& guard, V&& v) {
  auto& [active, latched, counts, gain, limit_N, armed, stopped] = guard;
  v("active", active);
  v("latched", latched);
  v("gain", gain);
  v("limit_N", limit_N);
  v("armed", armed);
  v("stopped", stopped);
  static_cast<void>(counts);
}

template <Is<realtime::GuardControl::Seen> T, class V>
void fields(T& seen, V&& v) {
  auto& [stopped, armed, rearms, ramps] = seen;
  v("stopped", stopped);
  v("armed", armed);
  v("rearms", rearms);
  v("ramps", ramps);
}

template <Is<realtime::EffectMemory> T, class V>
void fields(T& memory, V&& v) {
  auto& [index, begin, anchor, frequency_rad_per_s, angle_rad, since] = memory;
  v("index", index);
  v("begin_ns", begin);
  v("anchor_m", anchor);
  v("frequency_rad_per_s", frequency_rad_per_s);
  v("angle_rad", angle_rad);
  v("since_ns", since);
}

template <Is<realtime::PlaneMemory> T, class V>
void fields(T& memory, V&& v) {
  auto& [index, placed, depth_m, raised_m] = memory;
  v("index", index);
  v("placed_ns", placed);
  v("depth_m", depth_m);
  v("raised_m", raised_m);
}

template <Is<realtime::ThermalMemory> T, class V>
void fields(T& memory, V&& v) {
  auto& [impulse_Ns, newest, filled, derated] = memory;
  v("impulse_Ns", impulse_Ns);
  v("newest", newest);
  v("filled_ns", filled);
  v("derated", derated);
}

template <Is<realtime::GuardMemory> T, class V>
void fields(T& memory, V&& v) {
  auto& [shaped_N, waitForCalm, thermal] = memory;
  v("shaped_N", shaped_N);
  v("wait_for_calm", waitForCalm);
  v("thermal", thermal);
}

template <Is<realtime::RemoteContact> T, class V>
void fields(T& contact, V&& v) {
  auto& [id, shape, yields, radius_m, point_m, normal, axis, velocity_m_per_s, angularVelocity_rad_per_s,
         stiffness_N_per_m, damping_Ns_per_m, staticFriction, dynamicFriction, lifetime] = contact;
  v("id", id);
  v("shape", shape);
  v("yields", yields);
  v("radius_m", radius_m);
  v("point_m", point_m);
  v("normal", normal);
  v("axis", axis);
  v("velocity_m_per_s", velocity_m_per_s);
  v("angular_velocity_rad_per_s", angularVelocity_rad_per_s);
  v("stiffness_N_per_m", stiffness_N_per_m);
  v("damping_Ns_per_m", damping_Ns_per_m);
  v("static_friction", staticFriction);
  v("dynamic_friction", dynamicFriction);
  v("lifetime_ns", lifetime);
}

/// Without the contacts, of which there are `count`.
template <Is<realtime::RemoteContactSet> T, class V>
void fields(T& set, V&& v) {
  auto& [number, clientTime, received, stated, count, contacts] = set;
  v("number", number);
  v("client_time_ns", clientTime);
  v("received_ns", received);
  v("stated_ns", stated);
  v("count", count);
  static_cast<void>(contacts);
}

template <Is<realtime::EnergyBudget> T, class V>
void fields(T& budget, V&& v) {
  auto& [start_J, capacity_J, refill_W] = budget;
  v("start_J", start_J);
  v("capacity_J", capacity_J);
  v("refill_W", refill_W);
}

template <Is<realtime::HeldForce> T, class V>
void fields(T& force, V&& v) {
  auto& [number, clientTime, received, lifetime, force_N, budget] = force;
  v("number", number);
  v("client_time_ns", clientTime);
  v("received_ns", received);
  v("lifetime_ns", lifetime);
  v("force_N", force_N);
  v("budget", budget);
}

template <Is<realtime::RemoteMemory> T, class V>
void fields(T& memory, V&& v) {
  auto& [contacts, force, corrections_J, started, budget, energy_J, spent, cut] = memory;
  v("contacts", contacts);
  v("force", force);
  v("corrections_J", corrections_J);
  v("started", started);
  v("budget", budget);
  v("energy_J", energy_J);
  v("spent", spent);
  v("cut", cut);
}

template <Is<LeftEvent> T, class V>
void fields(T& event, V&& v) {
  auto& [scene, client, time] = event;
  v("scene", scene);
  v("client", client);
  v("time_ns", time);
}

}  // namespace hapticd::record
