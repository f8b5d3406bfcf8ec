#include "server/reports/report_group.h"

#include <algorithm>

namespace hapticd::server {
namespace {

ReportGroup::Frames takeBuffer(wire::FrameEncoder& encoder) {
  if (encoder.empty()) return nullptr;
  net::Buffer bytes;
  encoder.swapOut(bytes);
  return std::make_shared<const net::Buffer>(std::move(bytes));
}

bool isLowLatency(const Outgoing& out) {
  return wire::info(out.message.kind()).reliability == wire::Reliability::kLowLatency;
}

}  // namespace

ReportGroup::ReportGroup(const DeviceConfig& config, int buttonCount, const ReportChoice& choice,
                         const DeviceName& name)
    : name_(name.sender), reporter_(config, buttonCount, choice, name.view) {}

void ReportGroup::encode(const std::vector<Outgoing>& out, wire::Time time) {
  for (const Outgoing& each : out) {
    (isLowLatency(each) && !each.reliable ? lowLatency_ : reliable_).add(time, name_, each.message);
  }
}

void ReportGroup::add(const std::shared_ptr<const TimedTick>& tick, bool late) {
  outgoing_.clear();
  if (late) {
    reporter_.skip(tick->tick, tick->frame, outgoing_);
  } else {
    reporter_.update(tick->tick, tick->frame, outgoing_);
  }
  if (std::any_of(outgoing_.begin(), outgoing_.end(), isLowLatency)) reported_ = tick;
  encode(outgoing_, tick->time);
}

void ReportGroup::addFirst(const TimedTick& tick) {
  outgoing_.clear();
  reporter_.presentState(tick.tick, tick.frame, outgoing_);
  encode(outgoing_, tick.time);
}

void ReportGroup::add(const wire::Message& message, wire::Time time) {
  reliable_.add(time, name_, message);
}

bool ReportGroup::collect() {
  skipped_ += reporter_.takeSkipped();
  Link link{takeBuffer(lowLatency_), takeBuffer(reliable_), 0};
  if (!link.lowLatency && !link.reliable) return false;
  link.skipped = std::exchange(skipped_, 0);
  links_.push_back(std::move(link));
  state_.reset();
  return true;
}

void ReportGroup::beginPass() {
  while (begin_ < passed_) {
    links_.pop_front();
    ++begin_;
  }
  passed_ = end();
}

void ReportGroup::presentState(const TimedTick& newest, const SendMessage& send) const {
  // Buttons and guard are reported with every tick, due or not.
  TimedTick state = reported_ ? *reported_ : newest;
  state.tick.guard = newest.tick.guard;
  state.frame.buttons = newest.frame.buttons;
  std::vector<Outgoing> out;
  reporter_.presentState(state.tick, state.frame, newest.tick.rendering.touching, out);
  for (const Outgoing& each : out) send(each.message, isLowLatency(each) ? state.time : newest.time);
}

// Without what must not be lost: the client got all of that.
const ReportGroup::Frames& ReportGroup::stateOfLastLink() {
  if (state_) return state_;
  std::vector<Outgoing> state;
  reporter_.presentState(reported_->tick, reported_->frame, state);
  wire::FrameEncoder encoder;
  for (const Outgoing& each : state) {
    if (isLowLatency(each)) encoder.add(reported_->time, name_, each.message);
  }
  return state_ = takeBuffer(encoder);
}

}  // namespace hapticd::server
