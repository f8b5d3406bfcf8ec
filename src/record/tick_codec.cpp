#include "record/tick_codec.h"

#include <cmath>

#include "record/fields.h"

namespace hapticd::record {
namespace {

using realtime::TickRecord;

enum Has : std::uint8_t {
  kHaveState = 1U << 0,
  kWritten = 1U << 1,
  kPlacement = 1U << 2,
  kCounts = 1U << 3,
  kGripper = 1U << 4,
  kDiscarded = 1U << 5,
  kExpired = 1U << 6,
};

// The fields of every tick, in this order. `Record` may be const.
template <class Record, class V>
void always(Record& tick, V&& v) {
  auto& report = tick.report;
  v("tick", report.tick);
  v("time_ns", report.time);
  v("revision", report.revision);
  v("control", tick.control);
  v("timing", report.timing);
  v("device", report.device);
  v("rendering", report.rendering);
  v("force_N", report.force_N);
  v("guard", report.guard);
  v("dropped", report.dropped);
}

bool samePlacement(const realtime::TickReport& a, const realtime::TickReport& b) {
  return a.T_world_device.matrix() == b.T_world_device.matrix();
}

}  // namespace

void TickPacker::add(const TickRecord& tick, Bytes& out) {
  const realtime::TickReport& report = tick.report;
  const bool placement = first_ || !samePlacement(report, before_);
  const bool counts = first_ || report.guard.counts != before_.guard.counts;
  Packer pack(out);
  pack.put(static_cast<std::uint8_t>((tick.haveState ? kHaveState : 0) | (tick.written ? kWritten : 0) |
                                     (placement ? kPlacement : 0) | (counts ? kCounts : 0) |
                                     (report.device.gripper_rad ? kGripper : 0) |
                                     (tick.discarded ? kDiscarded : 0) | (tick.expired ? kExpired : 0)));
  always(tick, pack);
  for (std::uint32_t i = 0; i < report.rendering.contactCount; ++i) pack.put(report.rendering.contacts[i]);
  if (placement) pack.put(report.T_world_device);
  if (counts) pack.put(report.guard.counts);
  if (report.device.gripper_rad) pack.put(*report.device.gripper_rad);
  first_ = false;
  before_ = report;
}

void packStream(const realtime::StreamRecord& stream, Bytes& out) {
  const realtime::RemoteContactSet& set = stream.input.contacts;
  Packer pack(out);
  pack.put(stream.tick);
  pack.put(set);
  for (std::uint32_t i = 0; i < set.count; ++i) pack.put(set.contacts[i]);
  pack.put(stream.input.force);
}

bool unpackStream(Unpacker& in, realtime::StreamRecord& stream) {
  stream = realtime::StreamRecord();
  realtime::RemoteContactSet& set = stream.input.contacts;
  in.take(stream.tick);
  in.take(set);
  if (!in.ok() || set.count > set.contacts.size()) return false;
  for (std::uint32_t i = 0; i < set.count; ++i) in.take(set.contacts[i]);
  in.take(stream.input.force);
  return in.ok();
}

void packMemory(const realtime::ServoMemory& memory, Bytes& out) {
  const realtime::RenderMemory& render = memory.render;
  Packer pack(out);
  pack.put(memory.tick);
  pack.put(memory.whole);
  pack.put(render.effectCount);
  for (std::uint32_t i = 0; i < render.effectCount; ++i) pack.put(render.effects[i]);
  pack.put(render.planeCount);
  for (std::uint32_t i = 0; i < render.planeCount; ++i) pack.put(render.planes[i]);
  pack.put(render.buzzBegin);
  pack.put(memory.guard);
}

bool unpackMemory(Unpacker& in, realtime::ServoMemory& memory) {
  memory = realtime::ServoMemory();
  realtime::RenderMemory& render = memory.render;
  in.take(memory.tick);
  in.take(memory.whole);
  in.take(render.effectCount);
  if (render.effectCount > render.effects.size()) return false;
  for (std::uint32_t i = 0; i < render.effectCount; ++i) {
    in.take(render.effects[i]);
    if (render.effects[i].begin < 0 || render.effects[i].since < -1) return false;
  }
  in.take(render.planeCount);
  if (render.planeCount > render.planes.size()) return false;
  for (std::uint32_t i = 0; i < render.planeCount; ++i) {
    in.take(render.planes[i]);
    if (render.planes[i].placed < 0) return false;
  }
  in.take(render.buzzBegin);
  in.take(memory.guard);
  const realtime::ThermalMemory& thermal = memory.guard.thermal;
  return in.ok() && render.buzzBegin >= 0 && thermal.newest >= 0 &&
         thermal.newest <= realtime::ThermalMemory::kBuckets && thermal.filled >= 0 &&
         thermal.filled < realtime::ThermalMemory::kBucket;
}

void packRemoteMemory(const realtime::ServoMemory& memory, Bytes& out) {
  Packer pack(out);
  pack.put(memory.tick);
  pack.put(memory.remote);
}

bool unpackRemoteMemory(Unpacker& in, realtime::ServoMemory& memory) {
  in.take(memory.tick);
  in.take(memory.remote);
  const realtime::RemoteMemory& remote = memory.remote;
  const auto holds = [](const realtime::EnergyBudget& budget, double energy_J) {
    return std::isfinite(budget.capacity_J) && std::abs(energy_J) <= budget.capacity_J;
  };
  return in.ok() && holds({}, remote.corrections_J) && holds(remote.budget, remote.energy_J) &&
         std::isfinite(remote.budget.start_J) && std::isfinite(remote.budget.refill_W) && remote.cut >= 0 &&
         remote.cut <= 1;
}

bool TickUnpacker::next(TickRecord& tick) {
  if (!ok_ || in_.rest().empty()) return false;
  tick = TickRecord();
  const auto has = in_.next<std::uint8_t>();
  tick.haveState = (has & kHaveState) != 0;
  tick.written = (has & kWritten) != 0;
  tick.discarded = (has & kDiscarded) != 0;
  tick.expired = (has & kExpired) != 0;
  always(tick, in_);
  realtime::Rendering& rendering = tick.report.rendering;
  ok_ = in_.ok() && rendering.contactCount <= rendering.contacts.size();
  if (!ok_) return false;
  for (std::uint32_t i = 0; i < rendering.contactCount; ++i) in_.take(rendering.contacts[i]);
  tick.report.T_world_device = before_.T_world_device;
  tick.report.guard.counts = before_.guard.counts;
  if ((has & kPlacement) != 0) in_.take(tick.report.T_world_device);
  if ((has & kCounts) != 0) in_.take(tick.report.guard.counts);
  if ((has & kGripper) != 0) tick.report.device.gripper_rad = in_.next<double>();
  before_ = tick.report;
  ok_ = in_.ok();
  return ok_;
}

}  // namespace hapticd::record
