#include "scene/notice_board.h"

#include <algorithm>

namespace hapticd::scene {
namespace {

constexpr Nanos kWindow = 1'000'000'000;
constexpr int kShownInWindow = 8;

}  // namespace

void NoticeBoard::post(Notice notice, std::string kind, Nanos now, std::vector<Notice>& out) {
  Entry& entry = entries_[{notice.client, std::move(kind)}];
  if (entry.shown == 0) entry.windowEnd = now + kWindow;
  if (entry.shown < kShownInWindow && notice.text != entry.last.text) {
    ++entry.shown;
    out.push_back(notice);
  } else {
    ++entry.held;
  }
  entry.last = std::move(notice);
}

void NoticeBoard::flush(Nanos now, std::vector<Notice>& out) {
  for (auto it = entries_.begin(); it != entries_.end();) {
    Entry& entry = it->second;
    if (now < entry.windowEnd) {
      ++it;
      continue;
    }
    if (entry.held == 0) {
      it = entries_.erase(it);
      continue;
    }
    Notice notice = entry.last;
    notice.text = std::to_string(entry.held) + " more like this; the last: " + notice.text;
    out.push_back(std::move(notice));
    entry.held = 0;
    entry.shown = kShownInWindow;
    entry.windowEnd = now + kWindow;
    ++it;
  }
}

std::optional<Nanos> NoticeBoard::nextDeadline() const {
  std::optional<Nanos> next;
  for (const auto& [key, entry] : entries_) next = std::min(next.value_or(entry.windowEnd), entry.windowEnd);
  return next;
}

void NoticeBoard::forget(ClientId client) {
  std::erase_if(entries_, [client](const auto& entry) { return entry.first.first == client; });
}

}  // namespace hapticd::scene
