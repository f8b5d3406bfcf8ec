// Lists of callbacks whose members can be ended at any time, also while they run.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "hapticd/subscription.h"

namespace hapticd::detail {

/// One callback, whatever its report.
class CallbackEntry {
 public:
  CallbackEntry() = default;
  virtual ~CallbackEntry() = default;
  CallbackEntry(const CallbackEntry&) = delete;
  CallbackEntry& operator=(const CallbackEntry&) = delete;

  virtual void end() noexcept = 0;
  virtual bool active() const noexcept = 0;
};

}  // namespace hapticd::detail

namespace hapticd::client {

template <class Report>
class CallbackList {
 public:
  using Function = std::function<void(const Report&)>;

  Subscription add(Function function) {
    if (!calling_) removeEnded();
    entries_.push_back(std::make_shared<Entry>(std::move(function)));
    return Subscription(entries_.back());
  }

  /// Calls the callbacks in the order of their addition. Those added meanwhile wait for the next report;
  /// those ended meanwhile are not called. Not to be called from a callback.
  void call(const Report& report) {
    removeEnded();
    const Flag calling(calling_);
    const std::size_t count = entries_.size();
    for (std::size_t i = 0; i < count; ++i) {
      const std::shared_ptr<Entry> entry = entries_[i];  // additions may move the vector
      entry->call(report);
    }
  }

 private:
  struct Flag {
    bool& flag;
    explicit Flag(bool& f) : flag(f) { flag = true; }
    ~Flag() { flag = false; }
  };

  class Entry final : public detail::CallbackEntry {
   public:
    explicit Entry(Function function) : function_(std::move(function)) {}
    void call(const Report& report) {
      if (ended_ || !function_) return;
      const Running running(*this);
      function_(report);
    }
    void end() noexcept override {
      ended_ = true;
      if (!running_) function_ = nullptr;
    }
    bool active() const noexcept override { return !ended_; }

   private:
    struct Running {
      Entry& entry;
      explicit Running(Entry& e) : entry(e) { entry.running_ = true; }
      ~Running() {
        entry.running_ = false;
        if (entry.ended_) entry.function_ = nullptr;
      }
    };
    Function function_;
    bool running_ = false;
    bool ended_ = false;
  };

  void removeEnded() {
    std::erase_if(entries_, [](const auto& entry) { return !entry->active(); });
  }

  std::vector<std::shared_ptr<Entry>> entries_;
  bool calling_ = false;
};

}  // namespace hapticd::client
