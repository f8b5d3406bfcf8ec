// hapticd doctor: checks the usual causes of trouble on a machine, measures the servo loop, and prints a
// verdict with remedies.
#include <sys/resource.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "commands.h"
#include "device_list.h"
#include "isolation_check.h"
#include "loop_check.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"
#include "print_json.h"
#include "realtime/servo/thread_setup.h"

namespace hapticd::apps {
namespace {

enum class Verdict { good, note, bad };

struct Finding {
  Verdict verdict = Verdict::good;
  std::string what;
  std::string remedy;
};

void print(const Finding& finding) {
  static constexpr const char* kMarks[] = {"ok  ", "note", "BAD "};
  std::printf("  %s  %s\n", kMarks[static_cast<int>(finding.verdict)], finding.what.c_str());
  if (!finding.remedy.empty()) std::printf("        -> %s\n", finding.remedy.c_str());
}

std::string firstLine(const char* path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  return line;
}

Finding realtimePriority() {
  sched_param parameter{};
  parameter.sched_priority = 80;
  const int before = sched_getscheduler(0);
  if (sched_setscheduler(0, SCHED_FIFO, &parameter) == 0) {
    sched_param back{};
    sched_setscheduler(0, before, &back);
    return {Verdict::good, "SCHED_FIFO priority 80 is granted", ""};
  }
  return {Verdict::bad, "SCHED_FIFO is refused: " + std::string(std::strerror(errno)),
          realtime::realtimeRemedy()};
}

Finding memoryLock() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  if (geteuid() == 0 || limit.rlim_cur == RLIM_INFINITY)
    return {Verdict::good, "memory can be locked without limit", ""};
  const auto kib = static_cast<unsigned long>(limit.rlim_cur / 1024);
  return {Verdict::note,
          "only " + std::to_string(kib) +
              " KiB of memory can be locked: a page fault in the loop costs up to a millisecond",
          realtime::realtimeRemedy()};
}

Finding governor() {
  const std::string name = firstLine("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  if (name.empty()) return {Verdict::note, "no CPU frequency governor found (usual in virtual machines)", ""};
  if (name == "performance") return {Verdict::good, "CPU governor is 'performance'", ""};
  return {Verdict::note, "CPU governor is '" + name + "'",
          "sudo cpupower frequency-set -g performance (idle cores wake up late)"};
}

Finding timerResolution() {
  timespec resolution{};
  clock_getres(CLOCK_MONOTONIC, &resolution);
  const long nanoseconds = resolution.tv_sec * 1000000000L + resolution.tv_nsec;
  if (nanoseconds <= 1000)
    return {Verdict::good, "timer resolution is " + std::to_string(nanoseconds) + " ns", ""};
  return {Verdict::bad, "timer resolution is " + std::to_string(nanoseconds) + " ns",
          "use a kernel with high-resolution timers (CONFIG_HIGH_RES_TIMERS): a 1 kHz loop needs them"};
}

// Without preemption of system calls, even a SCHED_FIFO thread waits for other programs' calls to finish.
Finding preemption() {
  utsname kernel{};
  uname(&kernel);
  const std::string build = kernel.version;
  const std::string bootOptions = firstLine("/proc/cmdline");
  if (build.find("PREEMPT_RT") != std::string::npos)
    return {Verdict::good, "the kernel is a realtime kernel (PREEMPT_RT)", ""};
  const bool preemptible = build.find("PREEMPT") != std::string::npos;
  const bool enabled = build.find("PREEMPT_DYNAMIC") == std::string::npos ||
                       bootOptions.find("preempt=full") != std::string::npos;
  if (preemptible && enabled)
    return {Verdict::good, "the kernel preempts system calls of other programs", ""};
  return {Verdict::note,
          "long system calls of other programs may delay the loop by milliseconds (kernel: " + build + ")",
          preemptible ? "boot with preempt=full, or use a kernel with PREEMPT_RT"
                      : "use a kernel with PREEMPT_RT"};
}

// `open` binds the port as the server does.
Finding portFree(const std::string& protocol, std::uint16_t port,
                 const std::function<void(net::Loop&, const net::Endpoint&)>& open) {
  net::Loop loop;
  try {
    open(loop, {net::kLoopbackAddress, port});
    return {Verdict::good, protocol + " port " + std::to_string(port) + " is free", ""};
  } catch (const net::Error& error) {
    return {Verdict::note, error.what(), ""};
  }
}

Finding isolation(double seconds, bool realtimeGranted) {
  constexpr double kCheap_us = 20;
  try {
    const IsolationCheck check = measureIsolation(seconds);
    char text[256];
    std::snprintf(
        text, sizeof text,
        "from the driver's post to the tick p50 %.1f us, p99 %.1f us, max %.1f us (medians of %d rounds), "
        "plus one tick of delay",
        check.postToTick_us.p50, check.postToTick_us.p99, check.postToTick_us.max, check.rounds);
    if (check.postToTick_us.p99 < kCheap_us) return {Verdict::good, text, ""};
    return {Verdict::note, text,
            std::string("more than 20 us at the 99th percentile: ") +
                (realtimeGranted ? "a quiet machine helps" : "realtime rights and a quiet machine help")};
  } catch (const std::exception& error) {
    return {Verdict::note, std::string("the measurement failed: ") + error.what(), ""};
  }
}

nlohmann::json findingJson(const Finding& finding) {
  static constexpr const char* kVerdicts[] = {"ok", "note", "bad"};
  return {{"verdict", kVerdicts[static_cast<int>(finding.verdict)]},
          {"what", finding.what},
          {"remedy", finding.remedy}};
}

Finding steadiness(const LoopCheck& loop, bool realtimeGranted) {
  char text[256];
  std::snprintf(
      text, sizeof text,
      "%llu ticks, %llu overruns; wake-up error p50 %.0f us, p99 %.0f us, max %.0f us; compute p99 %.1f us",
      static_cast<unsigned long long>(loop.ticks), static_cast<unsigned long long>(loop.overruns),
      loop.wakeup_us.p50, loop.wakeup_us.p99, loop.wakeup_us.max, loop.compute_us.p99);
  const bool steady = loop.wakeup_us.p99 < 100 && loop.overruns * 1000 <= loop.ticks;
  if (steady) return {Verdict::good, text, ""};
  return {Verdict::bad, text,
          realtimeGranted ? "close other programs, or use a kernel with PREEMPT_RT"
                          : "get realtime rights for the loop; then close other programs"};
}

std::string shortNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

// Prints each finding at once, or all of them as JSON with the verdict.
class Examination {
 public:
  explicit Examination(bool json) : json_(json) {}

  void examineSystem() {
    title("realtime");
    const Finding priority = realtimePriority();
    realtimeGranted_ = priority.verdict == Verdict::good;
    add(priority);
    add(memoryLock());
    add(governor());
    add(timerResolution());
    add(preemption());
  }
  void examinePorts(std::uint16_t port) {
    title("network");
    add(portFree("TCP", port, [](net::Loop& loop, const net::Endpoint& local) {
      const net::TcpListener listener(loop, local, [](net::Connection) {});
    }));
    add(portFree("UDP", port, [](net::Loop& loop, const net::Endpoint& local) {
      const net::UdpSocket socket(loop, local);
    }));
  }
  void findDevices() {
    title("devices");
    devices_ = device::findDevices();
    if (!json_) printDevices(devices_);
  }
  void examineLoop(double seconds) {
    title("loop, " + shortNumber(seconds) + " s at 1 kHz with the simulated hand");
    loop_ = measureLoop(seconds);
    for (const std::string& line : loop_.setup) title("        " + line);
    add(steadiness(loop_, realtimeGranted_));
  }
  void examineIsolation(double seconds) {
    title("a driver in its own process (--isolate), " + shortNumber(seconds) + " s");
    add(isolation(seconds, realtimeGranted_));
  }

  // Returns the exit status.
  int conclude() const {
    const auto bad = count(Verdict::bad);
    if (json_) {
      printAll(bad == 0);
    } else if (bad == 0) {
      const auto notes = count(Verdict::note);
      std::printf("verdict: ready to render forces (%td %s above)\n", notes, notes == 1 ? "note" : "notes");
    } else {
      const std::string problems = bad == 1 ? "problem" : std::to_string(bad) + " problems";
      std::printf("verdict: fix the %s marked -> above first; the simulated hand runs without\n",
                  problems.c_str());
    }
    return bad == 0 ? 0 : 1;
  }

 private:
  void title(const std::string& text) const {
    if (json_) return;
    std::printf("%s\n", text.c_str());
    std::fflush(stdout);  // before a measurement
  }
  void add(const Finding& finding) {
    if (!json_) print(finding);
    findings_.push_back(finding);
  }
  std::ptrdiff_t count(Verdict verdict) const {
    return std::count_if(findings_.begin(), findings_.end(),
                         [&](const Finding& finding) { return finding.verdict == verdict; });
  }
  void printAll(bool ready) const {
    nlohmann::json checks = nlohmann::json::array();
    for (const Finding& finding : findings_) checks.push_back(findingJson(finding));
    printJson({{"ready", ready},
               {"checks", checks},
               {"devices", jsonOf(devices_)},
               {"loop",
                {{"ticks", loop_.ticks},
                 {"overruns", loop_.overruns},
                 {"wakeup_p50_us", loop_.wakeup_us.p50},
                 {"wakeup_p99_us", loop_.wakeup_us.p99},
                 {"wakeup_max_us", loop_.wakeup_us.max},
                 {"compute_p99_us", loop_.compute_us.p99}}}});
  }

  const bool json_;
  bool realtimeGranted_ = false;
  std::vector<Finding> findings_;
  std::vector<device::DriverReport> devices_;
  LoopCheck loop_;
};

int run(double seconds, std::uint16_t port, bool json) {
  Examination examination(json);
  examination.examineSystem();
  examination.examinePorts(port);
  examination.findDevices();
  examination.examineLoop(seconds);
  examination.examineIsolation(seconds);
  return examination.conclude();
}

}  // namespace

void addDoctor(CLI::App& app) {
  struct Options {
    double seconds = 3;
    std::uint16_t port = 3883;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "doctor",
      "Check this machine: realtime rights, memory lock, governor, timer, ports, vendor libraries, the loop");
  command->add_option("--seconds", options->seconds, "Duration of the loop measurement")
      ->check(within(0.1, 3600))
      ->capture_default_str();
  command->add_option("--port", options->port, "TCP and UDP port to check")
      ->check(withinIntegers(1, 65535))
      ->capture_default_str();
  command->footer("Exit status: 0 when ready, 1 when a problem must be fixed first.");
  command->add_flag("--json", options->json, kJsonText);
  command->callback([options] { exitCode = run(options->seconds, options->port, options->json); });
}

}  // namespace hapticd::apps
