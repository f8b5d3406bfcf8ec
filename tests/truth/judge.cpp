// hapticd_judge: random scenes and hands through the renderer, each tick judged by the referee.
//
// Without options: a fixed number of ticks from a fixed seed, as the tests run it. The last line is
// 'judged N ticks of M trials, F findings'. Exit status 1 with more findings than --allow, 2 for bad
// arguments.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>

#include "truth/random_trial.h"
#include "truth/referee.h"
#include "truth/session.h"
#include "truth/shrink.h"

namespace hapticd::truth {
namespace {

#ifdef HAPTICD_SANITIZED
constexpr std::uint64_t kTicks = 100'000;
#else
constexpr std::uint64_t kTicks = 1'000'000;
#endif

struct Options {
  std::uint64_t ticks = std::getenv("HAPTICD_LONG") != nullptr ? 3 * kTicks : kTicks;
  double seconds = 0;  // 0: ticks count
  std::uint64_t seed = 1;
  std::string kind;
  std::string replay;
  std::string out = "judge_findings";
  int findings = 20;  // ends there
  int allowed = 0;
  bool shrink = true;
};

constexpr const char* kUsage =
    "hapticd_judge [--ticks N | --seconds S] [--seed N] [--kind KIND] [--out DIR] [--findings N] [--allow N] "
    "[--no-shrink]\n"
    "hapticd_judge --replay FILE\n"
    "  --ticks     end after this many ticks\n"
    "  --seconds   end after this time\n"
    "  --seed      of the first trial; the following ones count up\n"
    "  --kind      of scene; default: all\n"
    "  --out       where shrunk findings are saved [judge_findings]\n"
    "  --findings  end after this many [20]\n"
    "  --allow     exit with success after up to this many findings [0]\n"
    "  --replay    judge one saved finding, every tick by all rules\n";

Options parsed(int count, char** words) {
  Options o;
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    if (word == "--help" || word == "-h") {
      std::fputs(kUsage, stdout);
      std::exit(0);
    }
    const auto value = [&]() -> std::string {
      if (i + 1 == count) throw std::invalid_argument(word + " needs a value");
      return words[++i];
    };
    if (word == "--ticks") {
      o.ticks = std::stoull(value());
    } else if (word == "--seconds") {
      o.seconds = std::stod(value());
    } else if (word == "--seed") {
      o.seed = std::stoull(value());
    } else if (word == "--kind") {
      o.kind = value();
    } else if (word == "--replay") {
      o.replay = value();
    } else if (word == "--out") {
      o.out = value();
    } else if (word == "--findings") {
      o.findings = std::stoi(value());
    } else if (word == "--allow") {
      o.allowed = std::stoi(value());
    } else if (word == "--no-shrink") {
      o.shrink = false;
    } else {
      throw std::invalid_argument("unknown option '" + word + "'");
    }
  }
  return o;
}

void print(const Trial& trial, const Finding& finding) {
  std::printf("seed %llu, scene '%s', tick %d: %s: %s\n", static_cast<unsigned long long>(trial.seed),
              trial.kind.c_str(), finding.tick, finding.rule.c_str(), finding.text.c_str());
}

class Judge {
 public:
  explicit Judge(const Options& options) : options_(options), begin_(std::chrono::steady_clock::now()) {}

  int run() {
    std::uint64_t seed = options_.seed;
    for (; !done(); ++seed) {
      const Trial trial = randomTrial(seed, options_.kind);
      const Verdict verdict = judge(trial);
      add(trial, verdict);
      if (verdict.finding) save(trial, *verdict.finding);
    }
    for (const auto& [kind, ticks] : byKind_)
      std::printf("  %-10s %llu ticks\n", kind.c_str(), static_cast<unsigned long long>(ticks));
    std::printf(
        "touching %llu, limited %llu, long rules %llu, searched %llu, undecided %llu; seeds %llu to %llu; "
        "%.2f us per "
        "tick\n",
        static_cast<unsigned long long>(sum_.touching), static_cast<unsigned long long>(sum_.limited),
        static_cast<unsigned long long>(sum_.longRules), static_cast<unsigned long long>(sum_.suspected),
        static_cast<unsigned long long>(sum_.undecided), static_cast<unsigned long long>(options_.seed),
        static_cast<unsigned long long>(seed - 1),
        seconds() / static_cast<double>(std::max<std::uint64_t>(sum_.ticks, 1)) * 1e6);
    std::printf("judged %llu ticks of %llu trials, %d findings\n",
                static_cast<unsigned long long>(sum_.ticks),
                static_cast<unsigned long long>(seed - options_.seed), findings_);
    return findings_ > options_.allowed ? 1 : 0;
  }

 private:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }
  bool done() const {
    if (findings_ >= options_.findings) return true;
    return options_.seconds > 0 ? seconds() >= options_.seconds : sum_.ticks >= options_.ticks;
  }
  void add(const Trial& trial, const Verdict& v) {
    sum_.ticks += v.ticks;
    sum_.touching += v.touching;
    sum_.limited += v.limited;
    sum_.suspected += v.suspected;
    sum_.undecided += v.undecided;
    sum_.longRules += v.longRules;
    byKind_[trial.kind] += v.ticks;
  }
  void save(const Trial& trial, const Finding& finding) {
    ++findings_;
    print(trial, finding);
    Trial small = options_.shrink ? shrink(trial, finding) : trial;
    std::filesystem::create_directories(options_.out);
    const std::string name = options_.out + "/" + finding.rule + "-" + std::to_string(trial.seed);
    std::ofstream file(name + ".trial");
    file << "# " << finding.rule << ": " << finding.text << '\n';
    write(file, small);
    std::printf("  shrunk to %zu triangles and %zu ticks: hapticd_judge --replay %s.trial\n",
                small.triangleCount(), small.hips.size(), name.c_str());
    if (writeSession(small, name + ".haptics"))
      std::printf("  as a recording: hapticd render --session %s.haptics\n", name.c_str());
    std::fflush(stdout);
  }

  const Options options_;
  const std::chrono::steady_clock::time_point begin_;
  Verdict sum_;
  int findings_ = 0;
  std::map<std::string, std::uint64_t> byKind_;
};

int replay(const std::string& name) {
  std::ifstream file(name);
  if (!file) throw std::runtime_error("cannot read '" + name + "'");
  const Trial trial = read(file);
  RefereeOptions options;
  options.share = 1;
  const Verdict verdict = judge(trial, options);
  if (verdict.finding) print(trial, *verdict.finding);
  std::printf("judged %llu ticks of 1 trials, %d findings\n", static_cast<unsigned long long>(verdict.ticks),
              verdict.finding ? 1 : 0);
  return verdict.finding ? 1 : 0;
}

}  // namespace
}  // namespace hapticd::truth

int main(int count, char** words) {
  using namespace hapticd::truth;
  try {
    const Options options = parsed(count, words);
    return options.replay.empty() ? Judge(options).run() : replay(options.replay);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "hapticd_judge: %s\n%s", error.what(), kUsage);
    return 2;
  }
}
