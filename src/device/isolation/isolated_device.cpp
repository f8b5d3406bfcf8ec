#include "device/isolation/isolated_device.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "base/world.h"

extern char** environ;

namespace hapticd::device {
namespace {

using namespace isolation;
constexpr Nanos kMillisecond = 1'000'000;
constexpr int kOpen_ms = 30000;
constexpr int kCalibrate_ms = 60000;
constexpr int kAnswer_ms = 2000;
constexpr int kGoodbye_ms = 200;  // of a silent process
constexpr int kEnding_ms = 100;
constexpr int kGlance_ms = 5;               // the thread that asks for a fault has other things to do
constexpr Nanos kNoAnswer = 5'000'000'000;  // less may be a busy machine
constexpr int kInterrupt_ms = 50;
constexpr int kStop_ms = 2;
constexpr Nanos kInOrder = 2'000'000'000;
constexpr Nanos kSilence = 20'000'000;
constexpr Nanos kSilentTick = 10'000'000;
constexpr double kOneTick_s = 0.001;
constexpr const char* kFault = "fault";  // the request for faultText()

struct NoAnswer : std::runtime_error {
  NoAnswer() : std::runtime_error("the driver's process does not answer") {}
};

// The text of an answer; throws it when it is a refusal.
std::string textOf(const std::string& answer) {
  if (!answer.starts_with('+')) throw std::runtime_error(answer.substr(1));
  return answer.substr(1);
}

}  // namespace

void IsolatedDevice::open() {
  if (process_ >= 0) return;
  memory_ = std::make_unique<SharedMemory>();
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
    throw std::system_error(errno, std::generic_category(), "socket to a driver's process");
  }
  socket_ = ends[0];
  unanswered_ = 0;
  late_.clear();
  fault_.reset();
  try {
    spawn(ends[1]);
    ::close(ends[1]);
    ends[1] = -1;
    textOf(receive(base::now() + kOpen_ms * kMillisecond, Wait::untilInterrupted));
  } catch (...) {
    if (ends[1] >= 0) ::close(ends[1]);
    close();
    throw;
  }
  try {
    profile_ = (*memory_)->profile.toProfile();
    traits_ = (*memory_)->profile.toTraits();
  } catch (...) {
    close();
    throw;
  }
  profile_.transportDelay_s += kOneTick_s;
  silent_ = lostThere_ = told_ = false;
}

void IsolatedDevice::spawn(int socketOfChild) {
  if (options_.command.empty()) throw std::runtime_error("no program for the driver's process is given");
  std::vector<char*> arguments;
  for (const std::string& word : options_.command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);

  // Above the target numbers, so that neither dup2 overwrites the other's source.
  const int memory = fcntl(memory_->descriptor(), F_DUPFD_CLOEXEC, 10);
  const int socket = fcntl(socketOfChild, F_DUPFD_CLOEXEC, 10);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);  // banners
  posix_spawn_file_actions_adddup2(&files, memory, kMemoryDescriptor);
  posix_spawn_file_actions_adddup2(&files, socket, kSocketDescriptor);
  // In a session of its own the process outlives the terminal of the server, whose end it notices by itself.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK);
  pid_t process = -1;
  const int error = posix_spawn(&process, arguments[0], &files, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  ::close(memory);
  ::close(socket);
  if (error != 0) throw std::system_error(error, std::generic_category(), options_.command.front());
  process_ = process;
}

std::string IsolatedDevice::receive(Nanos end, Wait wait, const Meanwhile& meanwhile) const {
  pollfd wanted{socket_, POLLIN, 0};
  for (;;) {
    if (meanwhile) meanwhile(end);
    if (wait == Wait::untilInterrupted && interrupted_)
      throw std::runtime_error("the device is being closed for good");
    const Nanos left_ms =
        std::clamp<Nanos>((end - base::now()) / kMillisecond, 0, meanwhile ? kStop_ms : kInterrupt_ms);
    if (poll(&wanted, 1, static_cast<int>(left_ms)) != 0) break;
    if (left_ms == 0) throw NoAnswer();
  }
  std::array<char, 4096> text;
  const long size = recv(socket_, text.data(), text.size(), 0);
  if (size <= 0) {
    const Nanos left_ms = std::clamp<Nanos>((end - base::now()) / kMillisecond, 0, kEnding_ms);
    throw std::runtime_error("the driver's process ended" + howItEnded(static_cast<int>(left_ms)) +
                             "; open the device anew");
  }
  return {text.data(), static_cast<std::size_t>(size)};
}

std::string IsolatedDevice::ask(const std::string& request, int most_ms) const {
  const std::unique_lock lock(socketMutex_, std::try_to_lock);
  if (!lock) throw std::runtime_error("the driver's process is busy with another request");
  if (socket_ < 0) throw std::runtime_error("the device is not open");
  send(request);
  return takeAnswers(base::now() + most_ms * kMillisecond, Wait::toTheEnd);
}

void IsolatedDevice::send(const std::string& request) const {
  ::send(socket_, request.data(), request.size(), MSG_NOSIGNAL);
  ++unanswered_;
  asked_ = base::now();
  faultAsked_ = request == kFault;
  askedWhileLost_ = lostThere_;
}

// Answers come in the order of the requests, and those to requests that timed out come first. A driver tells
// of some faults once, so the text of such an answer is kept.
std::string IsolatedDevice::takeAnswers(Nanos end, Wait wait, const Meanwhile& meanwhile) const {
  std::string answer = receive(end, wait, meanwhile);
  while (--unanswered_ > 0) {
    if (answer.size() > 1 && answer.starts_with('+')) late_ = answer.substr(1);
    answer = receive(end, wait, meanwhile);
  }
  return textOf(answer);
}

std::string IsolatedDevice::howItEnded(int most_ms) const {
  siginfo_t info{};
  const auto id = static_cast<id_t>(process_.load());
  for (int i = 0; i <= most_ms && info.si_pid == 0; ++i) {
    if (waitid(P_PID, id, &info, WEXITED | WNOHANG | WNOWAIT) != 0) break;
    if (info.si_pid == 0 && i < most_ms) base::sleepFor(kMillisecond);
  }
  if (info.si_pid == 0) return {};
  if (info.si_code == CLD_EXITED) return " with status " + std::to_string(info.si_status);
  return " by signal " + std::to_string(info.si_status) + " (" + strsignal(info.si_status) + ")";
}

void IsolatedDevice::close() noexcept {
  stop();
  {
    const std::lock_guard lock(socketMutex_);
    if (socket_ >= 0) ::close(socket_);  // the process ends in order
    socket_ = -1;
  }
  endProcess();
  memory_.reset();
}

void IsolatedDevice::endProcess() noexcept {
  const pid_t process = process_.exchange(-1);
  if (process < 0) return;
  const Nanos end = base::now() + kInOrder;
  do {
    if (waitpid(process, nullptr, WNOHANG) != 0) return;
    base::sleepFor(kMillisecond);
  } while (base::now() < end);
  kill(process, SIGKILL);
  waitpid(process, nullptr, 0);
}

void IsolatedDevice::start(std::function<void(Nanos)> onTick) {
  if (thread_.running()) return;
  ask("start", kAnswer_ms);
  onTick_ = std::move(onTick);
  stopping_ = false;
  lastPost_ = base::now();
  thread_ = base::BlockingThread({.name = "isolated device"}, [this] { run(); });
}

void IsolatedDevice::stop() noexcept {
  if (!thread_.running()) return;
  stopping_ = true;
  thread_.join();
  try {
    ask("stop", silent_ ? kGoodbye_ms : kAnswer_ms);
  } catch (const std::exception&) {
    // A process that is gone has stopped.
  }
}

void IsolatedDevice::run() noexcept {
  std::uint32_t seen = (*memory_)->posts.load(std::memory_order_acquire);
  while (!stopping_) {
    waitForPost(seen);
    const std::uint32_t posts = (*memory_)->posts.load(std::memory_order_acquire);
    const Nanos now = base::now();
    if (posts != seen) {
      period_ = now - lastPost_;
      lastPost_ = now;
    }
    silent_ = now - lastPost_ > kSilence;
    if (posts == seen && !silent_) continue;
    seen = posts;
    onTick_(now);
  }
}

void IsolatedDevice::waitForPost(std::uint32_t seen) const noexcept {
  constexpr Nanos kBefore = 150'000;  // a post may come early, and a sleep end late
  const std::atomic<std::uint32_t>& posts = (*memory_)->posts;
  if (options_.watches && period_ > kBefore && period_ < kSilentTick) {
    const Nanos begin = lastPost_ + period_ - kBefore;
    if (const Nanos left = begin - base::now(); left > 0) waitForChange(posts, seen, left);
    while (posts.load(std::memory_order_acquire) == seen && base::now() < begin + 2 * kBefore) {
    }
    if (posts.load(std::memory_order_acquire) != seen) return;
  }
  waitForChange(posts, seen, kSilentTick);
}

bool IsolatedDevice::read(Nanos now, DeviceState& state) noexcept {
  if (!memory_) return false;
  const Posted posted = (*memory_)->state.read();
  if (posted.valid == 0 && !silent_) return false;
  // The difference of any two numbers, without overflow; a state can have come after the tick began, or
  // never.
  const auto passed = static_cast<std::uint64_t>(now) - static_cast<std::uint64_t>(posted.time);
  postToTick_ = posted.valid == 0 ? 0 : std::max<Nanos>(0, static_cast<Nanos>(passed));
  lostThere_.store(posted.lost != 0, std::memory_order_relaxed);
  if (posted.valid != 0) state = posted.toState();
  if (silent_) state.hold |= kHoldFault;
  return true;
}

bool IsolatedDevice::write(const Vec3& force_N) noexcept {
  if (!memory_ || !force_N.allFinite()) return false;
  const Vec3 wanted_N = silent_ ? Vec3(Vec3::Zero()) : force_N;
  (*memory_)->command.write({wanted_N, ++commands_});
  sentZero_.wrote(commands_, wanted_N.isZero(0));
  return true;
}

bool IsolatedDevice::zeroSent() const noexcept {
  return memory_ && sentZero_.isSent((*memory_)->sentUpTo.load(std::memory_order_acquire));
}

// A command that is being written now has the next number at most.
bool IsolatedDevice::zeroFromOtherThread() noexcept {
  if (!memory_) return false;
  (*memory_)->endedUpTo.store(commands_.load() + 1, std::memory_order_release);
  return true;
}

std::string IsolatedDevice::faultText() const {
  if (silent_) {  // do not query a silent process
    const std::string ended = howItEnded(0);
    if (!ended.empty()) return "the driver's process ended" + ended + "; open the device anew";
    return "the driver's process posts no states; open the device anew";
  }
  const std::unique_lock lock(socketMutex_, std::try_to_lock);
  if (!lock) return "the driver's process is busy with another request";
  if (socket_ < 0) return "the device is not open";
  if (unanswered_ == 0 || !faultAsked_) send(kFault);
  try {
    fault_ = takeAnswers(base::now() + kGlance_ms * kMillisecond, Wait::toTheEnd);
    told_ = askedWhileLost_;
    const std::string late = std::exchange(late_, {});
    if (fault_->empty()) fault_ = late;
  } catch (const NoAnswer& error) {
    if (base::now() - asked_ > kNoAnswer) {
      told_ = true;
      return error.what();
    }
    if (!fault_) return "the driver's process has not answered yet";
  } catch (const std::exception& error) {
    return error.what();
  }
  return *fault_;
}

// After a stop the arm may move until the answer comes; a driver that gives none does not delay the end.
void IsolatedDevice::calibrate(const std::function<bool()>& stopped) {
  const std::unique_lock lock(socketMutex_, std::try_to_lock);
  if (!lock) throw std::runtime_error("the driver's process is busy with another request");
  if (socket_ < 0) throw std::runtime_error("the device is not open");
  std::atomic<std::uint32_t>& stops = (*memory_)->stopsCalibration;
  stops = 0;
  send("calibrate");
  const auto passOn = [&](Nanos& end) {
    if (stops != 0 || (!interrupted_ && !stopped())) return;
    stops = 1;
    end = base::now() + kAnswer_ms * kMillisecond;
  };
  try {
    takeAnswers(base::now() + kCalibrate_ms * kMillisecond, Wait::toTheEnd, passOn);
  } catch (...) {
    stops = 1;
    throw;
  }
}

}  // namespace hapticd::device
