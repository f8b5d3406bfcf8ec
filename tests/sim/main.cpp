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

}  // namespace

int main(int argc, char** argv) {
  // One thread only, also for the library that builds the index.
  setenv("HAPTICD_EMBREE", "threads=1,user_threads=1", 0);
  setenv("TZ", "UTC", 1);
  // The meshes of uploads are kept for the next ones, instead of new pages for each.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
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
  char** replayOptions = argv + argc;
  for (int i = 1; i < argc; ++i) {
    const std::string_view option = argv[i];
    const std::string_view value = i + 1 < argc ? argv[i + 1] : "";
    bool ok = true;
    if (option == "--help") {
      std::fputs(kHelp, stdout);
      return 0;
    }
    if (option == "--") {
      replayOptions = argv + i + 1;
      break;
    }
    if (option == "--seed" || option == "--watch") {
      ok = parse(value, first);
      last = first;
      watches = option == "--watch";
      ++i;
    } else if (option == "--seeds") {
      const std::size_t dash = value.find('-');
      ok = dash != std::string_view::npos && parse(value.substr(0, dash), first) &&
           parse(value.substr(dash + 1), last);
      ++i;
    } else if (option == "--seconds") {
      ok = parse(value, seconds) && seconds > 0 && seconds <= 86400;
      ++i;
    } else if (option == "--cpu") {
      ok = parse(value, cpu);
      ++i;
    } else if (option == "--first") {
      stopsAtFirst = true;
    } else if (option == "--twice") {
      twice = true;
    } else if (option == "--shrink") {
      wantsShrink = true;
    } else if (option == "--shrink-cpu") {
      ok = parse(value, shrinkCpu) && shrinkCpu > 0;
      ++i;
    } else if (option == "--verbose") {
      verbose = true;
    } else {
      ok = false;
    }
    if (!ok) {
      std::fprintf(stderr, "hapticd-sim: cannot use '%s %s'\n%s", std::string(option).c_str(),
                   std::string(value).c_str(), kHelp);
      return 2;
    }
  }

  if (watches) return watch(first, seconds, replayOptions);

  std::uint64_t runs = 0;
  std::uint64_t failed = 0;
  Outcome sum;
  double simulated = 0;
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    const Script script = hapticd::sim::drawScript(seed, seconds);
    Outcome outcome = run(script, verbose);
    if (twice) {
      const Outcome again = run(script);
      if (again.hash != outcome.hash)
        outcome.findings.push_back("a second run of the seed differs from the first");
    }
    ++runs;
    simulated += seconds;
    std::printf("seed %llu: %016llx, %llu ticks, %llu with force, %llu faults\n",
                static_cast<unsigned long long>(seed), static_cast<unsigned long long>(outcome.hash),
                static_cast<unsigned long long>(outcome.ticks),
                static_cast<unsigned long long>(outcome.ticksWithForce),
                static_cast<unsigned long long>(outcome.faults));
    for (const std::string& text : outcome.findings) std::printf("  finding: %s\n", text.c_str());
    if (!outcome.findings.empty()) {
      ++failed;
      if (wantsShrink) {
        std::printf("  what it needs:\n%s", describe(shrink(script, outcome, shrinkCpu)).c_str());
      }
    }
    std::fflush(stdout);
    sum.ticks += outcome.ticks;
    sum.ticksWithForce += outcome.ticksWithForce;
    sum.ticksInside += outcome.ticksInside;
    sum.steps += outcome.steps;
    sum.preemptions += outcome.preemptions;
    sum.faults += outcome.faults;
    sum.latches += outcome.latches;
    sum.stops += outcome.stops;
    sum.tickReports += outcome.tickReports;
    sum.missedReports += outcome.missedReports;
    sum.replayedTicks += outcome.replayedTicks;
    sum.seeks += outcome.seeks;
    sum.slowestStop = std::max(sum.slowestStop, outcome.slowestStop);
    if ((stopsAtFirst && failed > 0) || (cpu > 0 && cpuSeconds() > cpu)) break;
  }
  const auto u = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  std::printf(
      "%llu runs, %.0f s simulated, %llu ticks (%llu with force, %llu inside the cube), %llu steps, %llu "
      "preemptions, %llu faults, %llu latches, %llu stops (slowest read %.3f ms), %llu tick reports (%llu "
      "skipped), %llu ticks replayed, %llu seeks; %llu with findings\n",
      u(runs), simulated, u(sum.ticks), u(sum.ticksWithForce), u(sum.ticksInside), u(sum.steps),
      u(sum.preemptions), u(sum.faults), u(sum.latches), u(sum.stops),
      static_cast<double>(sum.slowestStop) * 1e-6, u(sum.tickReports), u(sum.missedReports),
      u(sum.replayedTicks), u(sum.seeks), u(failed));
  std::fprintf(stderr, "%.1f s of processor time, %.1f x real time\n", cpuSeconds(),
               simulated / cpuSeconds());
  return failed == 0 ? 0 : 1;
}
