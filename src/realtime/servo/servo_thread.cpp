#include "realtime/servo/servo_thread.h"

#include <stdexcept>
#include <utility>

#include "base/clock.h"

namespace hapticd::realtime {

ServoThread::ServoThread(std::function<void(const Pacing&)> tick, base::Clock& clock,
                         const ServoThreadOptions& options)
    : tick_(std::move(tick)), clock_(clock), options_(options), period_(servoPeriod(options.rate_Hz)) {}

ServoThread::~ServoThread() {
  stop();
}

const ThreadSetup& ServoThread::start() {
  thread_ = base::PacedThread({"servo"}, clock_, [this] { return step(); });
  isSetUp_.wait(false, std::memory_order_acquire);
  if (refused()) {
    thread_.join();
    throw std::runtime_error(refusalOf(setup_));
  }
  return setup_;
}

void ServoThread::stop() noexcept {
  requestStop();
  thread_.join();
}

bool ServoThread::refused() const noexcept {
  const auto refused = [](const SetupAnswer& answer) { return !answer.granted; };
  return options_.requireRealtime && (refused(setup_.scheduling) || refused(setup_.memory));
}

std::optional<Nanos> ServoThread::step() {
  if (!pacer_) {
    setup_ = setUpThread(options_.request);
    const bool leave = refused();
    pacer_.emplace(clock_.now(), period_);
    isSetUp_.store(true, std::memory_order_release);
    isSetUp_.notify_one();
    if (leave) return std::nullopt;
  } else {
    tick_(pacer_->begin(clock_.now()));
    pacer_->end(clock_.now());
  }
  if (stopping_.load(std::memory_order_acquire)) return std::nullopt;
  return pacer_->deadline();
}

}  // namespace hapticd::realtime
