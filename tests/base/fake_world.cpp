#include "base/fake_world.h"

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace hapticd::base {
namespace {

[[noreturn]] void fail(int error, const std::string& what, const std::filesystem::path& path) {
  throw std::system_error(error, std::generic_category(), what + " " + path.string());
}

}  // namespace

std::uint64_t SeededRandom::next() {
  std::uint64_t z = state_.fetch_add(0x9E3779B97F4A7C15U, std::memory_order_relaxed) + 0x9E3779B97F4A7C15U;
  z = (z ^ z >> 30U) * 0xBF58476D1CE4E5B9U;
  z = (z ^ z >> 27U) * 0x94D049BB133111EBU;
  return z ^ z >> 31U;
}

class FakeThreads::FakeThread final : public Thread::Impl {
 public:
  FakeThread(FakeThreads& threads, std::string threadName, Step step)
      : name(std::move(threadName)), threads_(threads), step_(std::move(step)) {}
  ~FakeThread() override { stop(); }

  void wake() noexcept override {
    if (stopped_) return;
    if (running_) {
      wokenWhileRunning_ = true;
    } else if (!due || *due > threads_.clock_.now()) {
      threads_.schedule(*this, threads_.clock_.now());
    }
  }

  void stop() override {
    if (stopped_) return;
    if (running_) throw std::logic_error("thread " + name + " stops itself from its own step");
    if (!hasRun_) callStep();
    callStep();
    stopped_ = true;
    std::erase(threads_.threads_, this);
  }

  void run() {
    due.reset();
    const std::optional<Nanos> deadline = callStep();
    if (stopped_) return;
    if (wokenWhileRunning_) {
      threads_.schedule(*this, threads_.clock_.now());
    } else if (deadline) {
      threads_.schedule(*this, *deadline);
    }
  }

  const std::string name;
  std::optional<Nanos> due;  // nothing: waits for a wake
  std::uint64_t turn = 0;    // orders those that are due

 private:
  std::optional<Nanos> callStep() {
    // stop() of one thread may run in the step of another.
    const std::string outer = std::exchange(threads_.current_, name);
    ++threads_.depth_;
    hasRun_ = running_ = true;
    wokenWhileRunning_ = false;
    struct Leave {
      FakeThread& thread;
      const std::string& outer;
      ~Leave() {
        thread.running_ = false;
        thread.threads_.current_ = outer;
        --thread.threads_.depth_;
      }
    } const leave{*this, outer};
    return step_();
  }

  FakeThreads& threads_;
  const Step step_;
  bool hasRun_ = false;
  bool running_ = false;
  bool wokenWhileRunning_ = false;
  bool stopped_ = false;
};

std::unique_ptr<Thread::Impl> FakeThreads::start(ThreadOptions options, Step step) {
  auto thread = std::make_unique<FakeThread>(*this, std::move(options.name), std::move(step));
  threads_.push_back(thread.get());
  schedule(*thread, clock_.now());
  return thread;
}

std::unique_ptr<BlockingThread::Impl> FakeThreads::startBlocking(ThreadOptions options,
                                                                 std::function<void()>) {
  throw std::logic_error("a simulated world cannot run the blocking thread " + options.name);
}

class FakeThreads::FakePacedThread final : public PacedThread::Impl {
 public:
  FakePacedThread(FakeThreads& threads, std::string name, Step step)
      : thread_(threads, std::move(name), [this, step = std::move(step)]() -> std::optional<Nanos> {
          if (ended_) return std::nullopt;
          const std::optional<Nanos> deadline = step();
          ended_ = !deadline;
          return deadline;
        }) {
    threads.threads_.push_back(&thread_);
    thread_.run();
  }

 private:
  bool ended_ = false;
  FakeThread thread_;  // last: its step uses the others
};

std::unique_ptr<PacedThread::Impl> FakeThreads::startPaced(ThreadOptions options, Clock&, Step step) {
  return std::make_unique<FakePacedThread>(*this, std::move(options.name), std::move(step));
}

void FakeThreads::schedule(FakeThread& thread, Nanos due) noexcept {
  thread.due = due;
  thread.turn = scheduled_++;
}

FakeThreads::FakeThread* FakeThreads::pick() {
  std::vector<FakeThread*> ready;
  for (FakeThread* thread : threads_) {
    if (thread->due && *thread->due <= clock_.now()) ready.push_back(thread);
  }
  if (ready.empty()) return nullptr;
  if (order_ != nullptr) return ready[order_->next() % ready.size()];
  return *std::min_element(ready.begin(), ready.end(), [](const FakeThread* a, const FakeThread* b) {
    return *a->due != *b->due ? *a->due < *b->due : a->turn < b->turn;
  });
}

bool FakeThreads::runNext() {
  if (depth_ != 0) throw std::logic_error("the step of thread " + current_ + " runs other steps");
  FakeThread* const thread = pick();
  if (thread == nullptr) return false;
  thread->run();
  return true;
}

std::size_t FakeThreads::runDue(std::size_t most) {
  std::size_t count = 0;
  while (runNext()) {
    if (++count == most) throw std::logic_error("steps are due without end at one moment");
  }
  return count;
}

std::size_t FakeThreads::runUntil(Nanos end) {
  std::size_t count = runDue();
  for (auto next = nextDeadline(); next && *next <= end; next = nextDeadline()) {
    clock_.sleepUntil(*next);
    count += runDue();
  }
  clock_.sleepUntil(end);
  return count;
}

std::optional<Nanos> FakeThreads::nextDeadline() const noexcept {
  std::optional<Nanos> next;
  for (const FakeThread* thread : threads_) {
    if (thread->due && (!next || *thread->due < *next)) next = thread->due;
  }
  return next;
}

std::vector<std::string> FakeThreads::names() const {
  std::vector<std::string> names;
  for (const FakeThread* thread : threads_) names.push_back(thread->name);
  return names;
}

class FakeFiles::FakeFile final : public OutputFile {
 public:
  FakeFile(FakeFiles& files, std::filesystem::path path, std::shared_ptr<Content> content)
      : files_(files), path_(std::move(path)), content_(std::move(content)) {}

  void write(std::span<const std::byte> bytes) override {
    if (files_.failures.write != 0) fail(files_.failures.write, "cannot write", path_);
    const std::size_t fits = files_.freeBytes ? std::min(*files_.freeBytes, bytes.size()) : bytes.size();
    content_->bytes.insert(content_->bytes.end(), bytes.begin(),
                           bytes.begin() + static_cast<std::ptrdiff_t>(fits));
    if (files_.freeBytes) *files_.freeBytes -= fits;
    if (fits < bytes.size()) fail(ENOSPC, "cannot write", path_);
  }

  void sync() override {
    if (files_.failures.sync != 0) fail(files_.failures.sync, "cannot sync", path_);
    content_->onDisk = content_->bytes;
    ++content_->syncs;
  }

  bool isGone() const noexcept override {
    return std::none_of(files_.files_.begin(), files_.files_.end(),
                        [this](const auto& entry) { return entry.second == content_; });
  }

 private:
  FakeFiles& files_;
  const std::filesystem::path path_;
  const std::shared_ptr<Content> content_;  // as an inode: survives rename and remove
};

class FakeFiles::FakeInput final : public InputFile {
 public:
  explicit FakeInput(std::shared_ptr<const Content> content)
      : content_(std::move(content)), size_(content_->bytes.size()) {}

  std::uint64_t size() const override { return size_; }
  std::size_t read(std::span<std::byte> into) override {
    const std::size_t end = content_->bytes.size();
    const std::size_t from = std::min(at_, end);  // it may have been cut since
    const std::size_t count = std::min(into.size(), end - from);
    std::copy_n(content_->bytes.begin() + static_cast<std::ptrdiff_t>(from), count, into.begin());
    at_ = from + count;
    return count;
  }

 private:
  const std::shared_ptr<const Content> content_;
  const std::size_t size_;
  std::size_t at_ = 0;
};

std::string FakeFiles::keyOf(const std::filesystem::path& path) {
  std::string key = path.lexically_normal().string();
  while (key.size() > 1 && key.back() == '/') key.pop_back();
  return key.empty() ? "." : key;
}

std::shared_ptr<const FakeFiles::Content> FakeFiles::find(const std::filesystem::path& path) const {
  const auto it = files_.find(keyOf(path));
  return it == files_.end() ? nullptr : it->second;
}

std::unique_ptr<OutputFile> FakeFiles::create(const std::filesystem::path& path, Existing existing) {
  const std::string key = keyOf(path);
  if (failures.open != 0) fail(failures.open, "cannot open", path);
  if (folders_.contains(key)) fail(EISDIR, "cannot open", path);
  if (!folders_.contains(keyOf(std::filesystem::path(key).parent_path()))) fail(ENOENT, "cannot open", path);
  std::shared_ptr<Content>& content = files_[key];
  if (content != nullptr && existing == Existing::refuse) fail(EEXIST, "cannot open", path);
  if (content == nullptr) content = std::make_shared<Content>();
  if (freeBytes) *freeBytes += content->bytes.size();
  content->bytes.clear();
  return std::make_unique<FakeFile>(*this, path, content);
}

std::shared_ptr<const FakeFiles::Content> FakeFiles::findToRead(const std::filesystem::path& path) const {
  if (failures.open != 0) fail(failures.open, "cannot open", path);
  if (folders_.contains(keyOf(path))) fail(EISDIR, "cannot read", path);
  std::shared_ptr<const Content> content = find(path);
  if (content == nullptr) fail(ENOENT, "cannot open", path);
  return content;
}

std::unique_ptr<InputFile> FakeFiles::open(const std::filesystem::path& path) {
  return std::make_unique<FakeInput>(findToRead(path));
}

std::vector<std::byte> FakeFiles::read(const std::filesystem::path& path) {
  return findToRead(path)->bytes;
}

void FakeFiles::rename(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (failures.rename != 0) fail(failures.rename, "cannot rename " + from.string() + " to", to);
  const auto it = files_.find(keyOf(from));
  const bool hasFolder = folders_.contains(keyOf(std::filesystem::path(keyOf(to)).parent_path()));
  if (it == files_.end() || !hasFolder) fail(ENOENT, "cannot rename " + from.string() + " to", to);
  const std::shared_ptr<Content> content = it->second;
  files_.erase(it);
  files_[keyOf(to)] = content;
}

void FakeFiles::remove(const std::filesystem::path& path) {
  const auto it = files_.find(keyOf(path));
  if (it == files_.end()) return;
  if (freeBytes) *freeBytes += it->second->bytes.size();
  files_.erase(it);
}

void FakeFiles::createFolder(const std::filesystem::path& path) {
  std::filesystem::path folder;
  for (const auto& part : std::filesystem::path(keyOf(path))) {
    folder /= part;
    if (files_.contains(keyOf(folder))) fail(ENOTDIR, "cannot create folder", path);
    folders_.insert(keyOf(folder));
  }
}

std::vector<std::string> FakeFiles::list(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& [key, content] : files_) {
    if (keyOf(std::filesystem::path(key).parent_path()) == keyOf(folder)) {
      names.push_back(std::filesystem::path(key).filename().string());
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool FakeFiles::exists(const std::filesystem::path& path) const {
  return find(path) != nullptr;
}

std::string FakeFiles::text(const std::filesystem::path& path) const {
  std::string text;
  if (const auto content = find(path)) {
    for (const std::byte b : content->bytes) text += static_cast<char>(b);
  }
  return text;
}

int FakeFiles::syncs(const std::filesystem::path& path) const {
  const auto content = find(path);
  return content == nullptr ? 0 : content->syncs;
}

void FakeFiles::losePower() {
  for (const auto& [key, content] : files_) content->bytes = content->onDisk;
}

}  // namespace hapticd::base
