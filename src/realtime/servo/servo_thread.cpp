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
  thread_ = base::BlockingThread({"servo"}, [this] { run(); });
  isSetUp_.wait(false, std::memory_order_acquire);
  const auto refused = [](const SetupAnswer& answer) { return !answer.granted; };
  const bool leave = options_.requireRealtime && (refused(setup_.scheduling) || refused(setup_.memory));
  go_.store(leave ? Go::leave : Go::run, std::memory_order_release);
  go_.notify_one();
  if (leave) {
    thread_.join();
    throw std::runtime_error("the system refused what the servo thread of a real device requires\n" +
                             setup_.complaints() +
                             "; --allow-no-rt starts without: late ticks then make the force rough");
  }
  return setup_;
}

void ServoThread::stop() noexcept {
  requestStop();
  thread_.join();
}

void ServoThread::run() {
  setup_ = setUpThread(options_.request);
  isSetUp_.store(true, std::memory_order_release);
  isSetUp_.notify_one();
  go_.wait(Go::wait, std::memory_order_acquire);
  if (go_.load(std::memory_order_acquire) == Go::run) loop();
}

void ServoThread::loop() noexcept {
  Pacer pacer(clock_.now(), period_);
  while (!stopping_.load(std::memory_order_acquire)) {
    clock_.sleepUntil(pacer.deadline());
    tick_(pacer.begin(clock_.now()));
    pacer.end(clock_.now());
  }
}

}  // namespace hapticd::realtime
