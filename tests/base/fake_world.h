// A world in memory: time that moves when told, threads that run in the calling thread, files that can fail.
//
// Everything is deterministic for one seed, and everything belongs to the thread that made the world.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/world.h"

namespace hapticd::base {

/// The same numbers for the same seed (SplitMix64; Steele, Lea and Flood 2014).
class SeededRandom final : public Random {
 public:
  explicit SeededRandom(std::uint64_t seed) noexcept : state_(seed) {}
  std::uint64_t next() override;

 private:
  std::atomic<std::uint64_t> state_;
};

/// Threads without threads: a step runs when runNext() or one of its relatives is called, never inside wake()
/// or the constructor of a Thread. stop() runs the steps that a real thread would still run. Outlives its
/// threads.
class FakeThreads final : public Threads {
 public:
  /// Steps run in the order in which they became due. With `order`, each next one is drawn from all that are
  /// due.
  explicit FakeThreads(SimulatedClock& clock, Random* order = nullptr) noexcept
      : clock_(clock), order_(order) {}

  std::unique_ptr<Thread::Impl> start(ThreadOptions options, Step step) override;
  /// Throws std::logic_error with the name: a thread that blocks cannot share one thread with others.
  std::unique_ptr<BlockingThread::Impl> startBlocking(ThreadOptions options,
                                                      std::function<void()> body) override;
  /// The first step runs at once, the last one when the thread is joined.
  std::unique_ptr<PacedThread::Impl> startPaced(ThreadOptions options, Clock& clock, Step step) override;
  bool simulated() const noexcept override { return true; }

  /// Runs one step that is due now. False when there is none. What a step throws leaves here. Throws
  /// std::logic_error when called from within a step.
  bool runNext();
  /// Runs steps until none is due now, and returns how many. Throws std::logic_error after `most` of them:
  /// the threads keep waking each other.
  std::size_t runDue(std::size_t most = 1'000'000);
  /// Runs all steps that are due up to `end`, each at its time, and leaves the clock at `end`. Returns how
  /// many.
  std::size_t runUntil(Nanos end);
  /// When the next step is due, which may be now or earlier; nothing while all threads wait for a wake().
  std::optional<Nanos> nextDeadline() const noexcept;
  /// Names of the threads that have not been stopped, in the order of their start.
  std::vector<std::string> names() const;
  /// Name of the thread whose step runs; empty between steps.
  const std::string& current() const noexcept { return current_; }

 private:
  class FakeThread;
  class FakePacedThread;

  void schedule(FakeThread& thread, Nanos due) noexcept;
  FakeThread* pick();

  SimulatedClock& clock_;
  Random* const order_;
  std::vector<FakeThread*> threads_;
  std::uint64_t scheduled_ = 0;
  int depth_ = 0;  // of steps that run: a step may stop another thread
  std::string current_;
};

/// Files in memory, with the errors of SystemFiles and more on demand. Folders must be created before their
/// files; "/" and the current folder exist.
class FakeFiles final : public Files {
 public:
  /// An errno value makes every such call fail with it until it is 0 again.
  struct Failures {
    int open = 0;  ///< create(), open() and read()
    int write = 0;
    int sync = 0;
    int rename = 0;
  };
  Failures failures;
  /// Bytes that still fit on the disk. A write beyond takes what fits (a short write) and then fails with
  /// ENOSPC.
  std::optional<std::size_t> freeBytes;

  std::unique_ptr<OutputFile> create(const std::filesystem::path& path, Existing existing) override;
  std::unique_ptr<InputFile> open(const std::filesystem::path& path) override;
  std::vector<std::byte> read(const std::filesystem::path& path) override;
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override;
  void remove(const std::filesystem::path& path) override;
  void createFolder(const std::filesystem::path& path) override;
  std::vector<std::string> list(const std::filesystem::path& folder) override;

  bool exists(const std::filesystem::path& path) const;
  /// The content as text; empty when absent.
  std::string text(const std::filesystem::path& path) const;
  /// How often a file at `path` was synced.
  int syncs(const std::filesystem::path& path) const;
  /// As a loss of power: every file keeps what it held at its last sync. Files that are open may still be
  /// written.
  void losePower();

 private:
  struct Content {
    std::vector<std::byte> bytes;
    std::vector<std::byte> onDisk;
    int syncs = 0;
  };
  class FakeFile;
  class FakeInput;

  static std::string keyOf(const std::filesystem::path& path);
  std::shared_ptr<const Content> find(const std::filesystem::path& path) const;
  std::shared_ptr<const Content> findToRead(const std::filesystem::path& path) const;

  std::map<std::string, std::shared_ptr<Content>> files_;
  std::set<std::string> folders_{"/", "."};
};

/// All of them together, in the place of the machine's world while it lives. Time begins at 0.
class FakeWorld {
 public:
  static constexpr Nanos kWallAtZero = 1'600'000'000'000'000'000;  ///< 13 September 2020, 12:26:40 UTC

  explicit FakeWorld(std::uint64_t seed = 1) : random(seed) {}

  SimulatedClock clock{kWallAtZero};
  SeededRandom random;
  FakeThreads threads{clock};
  FakeFiles files;

 private:
  ScopedWorld scope_{World{clock, threads, files, random}};
};

}  // namespace hapticd::base
