// hapticd-sim: the whole server in one thread on a virtual clock, among clients and faults drawn from a seed.
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/simulation.h"

namespace {

using hapticd::sim::Action;
using hapticd::sim::Outcome;
using hapticd::sim::Script;

constexpr char kHelp[] =
    "Usage: hapticd-sim [--seeds A-B | --seed N] [--seconds S] [--cpu S] [--first] [--twice] [--shrink] "
    "[--shrink-cpu S] [--verbose]\n"
    "       hapticd-sim --watch SEED [--seconds S] [-- OPTIONS]\n"
    "Runs the whole server in one thread on a virtual clock, among clients and faults drawn from a seed.\n"
    "  --seeds A-B    these seeds (1-20)\n"
    "  --seed N       one seed\n"
    "  --seconds S    virtual seconds of each run (20)\n"
    "  --cpu S        ends after the run in which this much processor time was spent\n"
    "  --first        ends after the first run with a finding\n"
    "  --twice        runs each seed twice and requires the same hash\n"
    "  --shrink       after a finding: removes what it does not need, and prints the rest\n"
    "  --shrink-cpu S after this much processor time for each finding, the shortest so far (60)\n"
    "  --verbose      prints the log of the server with virtual times\n"
    "  --watch SEED   runs one seed with a recorder and serves the recording to the viewer; OPTIONS are "
    "those of "
    "'hapticd replay'\n"
    "Exit status: 0 without findings, 1 with, 2 for a wrong command line.\n";

// Becomes 'hapticd replay', which lies beside this program. Returns only when that fails.
int watch(std::uint64_t seed, double seconds, char** replayOptions) {
  Script script = hapticd::sim::drawScript(seed, seconds);
  if (!script.record)
    std::printf("this seed has no recorder: with one, threads take turns in another order\n");
  script.record = true;
  std::vector<std::byte> recording;
  const Outcome outcome = run(script, false, &recording);
  for (const std::string& text : outcome.findings) std::printf("finding: %s\n", text.c_str());
  const auto file =
      std::filesystem::temp_directory_path() / ("hapticd-sim-" + std::to_string(seed) + ".haptics");
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(recording.data()), static_cast<std::streamsize>(recording.size()));
  out.close();
  if (!out) {
    std::fprintf(stderr, "hapticd-sim: cannot write '%s'\n", file.c_str());
    return 1;
  }
  std::printf("%s: %.1f s\n", file.c_str(), seconds);
  std::fflush(stdout);
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").replace_filename("hapticd");
  std::string replay = "replay";
  std::string name = file;
  std::vector<char*> arguments{replay.data(), replay.data(), name.data()};
  while (*replayOptions != nullptr) arguments.push_back(*replayOptions++);
  arguments.push_back(nullptr);
  execv(program.c_str(), arguments.data());
  std::fprintf(stderr, "hapticd-sim: cannot run '%s': %s\n", program.c_str(), std::strerror(errno));
  return 1;
}

double cpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

template <class T>
bool parse(std::string_view text, T& value) {
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc() && result.ptr == text.data() + text.size();
}

// The words of a finding before its numbers: what makes two findings the same.
std::string kindOf(const Outcome& outcome) {
  if (outcome.findings.empty()) return {};
  std::string kind;
  for (const char c : outcome.findings.front()) {
    if (std::strchr("0123456789.-", c) == nullptr) kind += c;
  }
  return kind.substr(0, 60);
}

// Removes actions and faults for as long as a finding of the same kind remains and time is left.
Script shrink(Script script, const Outcome& first, double budget_s) {
  const std::string kind = kindOf(first);
  const double begin_s = cpuSeconds();
  const auto left = [&] { return cpuSeconds() - begin_s < budget_s; };
  std::size_t tried = 0;
  const auto still = [&](const Script& candidate) {
    if (!left()) return false;
    ++tried;
    if (kindOf(run(candidate)) != kind) return false;
    std::fprintf(stderr, "  %zu tried in %.1f s: %.3f s with %zu actions\n", tried, cpuSeconds() - begin_s,
                 hapticd::base::toSeconds(candidate.length), candidate.actions.size());
    return true;
  };
  Script shorter = script;
  shorter.length = first.firstFinding + 50'000'000;
  std::erase_if(shorter.actions, [&](const Action& action) { return action.at > shorter.length; });
  if (shorter.length < script.length && still(shorter)) script = shorter;
  const auto without = [&](auto member) {
    Script candidate = script;
    if (member(candidate) == 0) return;
    member(candidate) = 0;
    if (still(candidate)) script = candidate;
  };
  without([](Script& s) -> double& { return s.adversity.preempt; });
  without([](Script& s) -> double& { return s.adversity.lateTick; });
  without([](Script& s) -> double& { return s.adversity.netStall; });
  without([](Script& s) -> double& { return s.adversity.sceneStall; });
  without([](Script& s) -> double& { return s.adversity.freeze; });
  for (double hapticd::sim::DeviceFaults::*fault :
       {&hapticd::sim::DeviceFaults::noState, &hapticd::sim::DeviceFaults::notFinite,
        &hapticd::sim::DeviceFaults::hold, &hapticd::sim::DeviceFaults::fault,
        &hapticd::sim::DeviceFaults::leap, &hapticd::sim::DeviceFaults::refuse,
        &hapticd::sim::DeviceFaults::hang, &hapticd::sim::DeviceFaults::lost})
    without([fault](Script& s) -> double& { return s.faults.*fault; });
  without([](Script& s) -> hapticd::base::Nanos& { return s.networkJitter; });
  for (std::size_t part = std::max<std::size_t>(script.actions.size() / 2, 1); part > 0; part /= 2) {
    for (std::size_t at = 0; at < script.actions.size() && left();) {
      Script candidate = script;
      const auto begin = candidate.actions.begin() + static_cast<std::ptrdiff_t>(at);
      const auto count = std::min(part, candidate.actions.size() - at);
      candidate.actions.erase(begin, begin + static_cast<std::ptrdiff_t>(count));
      if (still(candidate)) {
        script = candidate;
      } else {
        at += part;
      }
    }
  }
  if (!left()) std::printf("  not all was tried in %.0f s\n", budget_s);
  return script;
}

struct Options {
  std::uint64_t first = 1;
  std::uint64_t last = 20;
  double seconds = 20;
  double cpu = 0;
  double shrinkCpu = 60;
  bool twice = false;
  bool stopsAtFirst = false;
  bool wantsShrink = false;
  bool verbose = false;
  bool watches = false;
  bool help = false;
  char** replayOptions = nullptr;  // ends with a null
};

// Nothing, or what cannot be used.
std::optional<std::string> read(int argc, char** argv, Options& to) {
  to.replayOptions = argv + argc;
  for (int i = 1; i < argc; ++i) {
    const std::string_view option = argv[i];
    const std::string_view value = i + 1 < argc ? argv[i + 1] : "";
    bool ok = true;
    if (option == "--") {
      to.replayOptions = argv + i + 1;
      return {};
    }
    if (option == "--seed" || option == "--watch") {
      ok = parse(value, to.first);
      to.last = to.first;
      to.watches = option == "--watch";
      ++i;
    } else if (option == "--seeds") {
      const std::size_t dash = value.find('-');
      ok = dash != std::string_view::npos && parse(value.substr(0, dash), to.first) &&
           parse(value.substr(dash + 1), to.last);
      ++i;
    } else if (option == "--seconds") {
      ok = parse(value, to.seconds) && to.seconds > 0 && to.seconds <= 86400;
      ++i;
    } else if (option == "--cpu") {
      ok = parse(value, to.cpu);
      ++i;
    } else if (option == "--shrink-cpu") {
      ok = parse(value, to.shrinkCpu) && to.shrinkCpu > 0;
      ++i;
    } else if (option == "--help") {
      to.help = true;
    } else if (option == "--first") {
      to.stopsAtFirst = true;
    } else if (option == "--twice") {
      to.twice = true;
    } else if (option == "--shrink") {
      to.wantsShrink = true;
    } else if (option == "--verbose") {
      to.verbose = true;
    } else {
      ok = false;
    }
    if (!ok) return std::string(option) + ' ' + std::string(value);
  }
  return {};
}

unsigned long long u(std::uint64_t n) {
  return n;
}

Outcome runSeed(std::uint64_t seed, const Options& options) {
  const Script script = hapticd::sim::drawScript(seed, options.seconds);
  Outcome outcome = run(script, options.verbose);
  if (options.twice && run(script).hash != outcome.hash)
    outcome.findings.push_back("a second run of the seed differs from the first");
  std::printf("seed %llu: %016llx, %llu ticks, %llu with force, %llu faults\n", u(seed), u(outcome.hash),
              u(outcome.ticks), u(outcome.ticksWithForce), u(outcome.faults));
  for (const std::string& text : outcome.findings) std::printf("  finding: %s\n", text.c_str());
  if (!outcome.findings.empty() && options.wantsShrink)
    std::printf("  what it needs:\n%s", describe(shrink(script, outcome, options.shrinkCpu)).c_str());
  std::fflush(stdout);
  return outcome;
}

class Total {
 public:
  void add(const Outcome& outcome, double seconds) {
    ++runs_;
    failed_ += outcome.findings.empty() ? 0U : 1U;
    simulated_s_ += seconds;
    sum_.ticks += outcome.ticks;
    sum_.ticksWithForce += outcome.ticksWithForce;
    sum_.ticksInside += outcome.ticksInside;
    sum_.steps += outcome.steps;
    sum_.preemptions += outcome.preemptions;
    sum_.faults += outcome.faults;
    sum_.latches += outcome.latches;
    sum_.stops += outcome.stops;
    sum_.tickReports += outcome.tickReports;
    sum_.missedReports += outcome.missedReports;
    sum_.replayedTicks += outcome.replayedTicks;
    sum_.seeks += outcome.seeks;
    sum_.slowestStop = std::max(sum_.slowestStop, outcome.slowestStop);
  }
  std::uint64_t failed() const { return failed_; }
  void print() const {
    std::printf(
        "%llu runs, %.0f s simulated, %llu ticks (%llu with force, %llu inside the cube), %llu steps, %llu "
        "preemptions, %llu faults, %llu latches, %llu stops (slowest read %.3f ms), %llu tick reports (%llu "
        "skipped), %llu ticks replayed, %llu seeks; %llu with findings\n",
        u(runs_), simulated_s_, u(sum_.ticks), u(sum_.ticksWithForce), u(sum_.ticksInside), u(sum_.steps),
        u(sum_.preemptions), u(sum_.faults), u(sum_.latches), u(sum_.stops),
        static_cast<double>(sum_.slowestStop) * 1e-6, u(sum_.tickReports), u(sum_.missedReports),
        u(sum_.replayedTicks), u(sum_.seeks), u(failed_));
    std::fprintf(stderr, "%.1f s of processor time, %.1f x real time\n", cpuSeconds(),
                 simulated_s_ / cpuSeconds());
  }

 private:
  std::uint64_t runs_ = 0;
  std::uint64_t failed_ = 0;
  double simulated_s_ = 0;
  Outcome sum_;
};

}  // namespace

int main(int argc, char** argv) {
  // One thread only, also for the library that builds the index.
  setenv("HAPTICD_EMBREE", "threads=1,user_threads=1", 0);
  setenv("TZ", "UTC", 1);
  // The meshes of uploads are kept for the next ones, instead of new pages for each.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  Options options;
  if (const auto wrong = read(argc, argv, options)) {
    std::fprintf(stderr, "hapticd-sim: cannot use '%s'\n%s", wrong->c_str(), kHelp);
    return 2;
  }
  if (options.help) {
    std::fputs(kHelp, stdout);
    return 0;
  }
  if (options.watches) return watch(options.first, options.seconds, options.replayOptions);

  Total total;
  for (std::uint64_t seed = options.first; seed <= options.last; ++seed) {
    total.add(runSeed(seed, options), options.seconds);
    if (options.stopsAtFirst && total.failed() > 0) break;
    if (options.cpu > 0 && cpuSeconds() > options.cpu) break;
  }
  total.print();
  return total.failed() == 0 ? 0 : 1;
}
