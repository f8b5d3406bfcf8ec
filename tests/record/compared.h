// The ticks of a recording, compared with those of its re-rendering.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iomanip>
#include <set>
#include <sstream>
#include <string>
#include <variant>
#include <vector>

#include "realtime/servo/report.h"
#include "record/recording_reader.h"
#include "record/rerender.h"

namespace hapticd::test {

struct Compared {
  std::uint64_t ticks = 0;
  std::uint64_t skipped = 0;
  std::uint64_t same = 0;
  std::uint64_t touching = 0;
  std::uint64_t stopped = 0;
  std::set<std::uint64_t> revisions;
  double largest_N = 0;          // as written
  double largestRendered_N = 0;  // before the guard, which on a stalled machine lets little through
  std::string firstDifference;
};

/// To all digits, for last bits may be what differs.
inline std::string summary(const realtime::TickReport& report) {
  const realtime::Rendering& r = report.rendering;
  const realtime::GuardReport& g = report.guard;
  std::ostringstream text;
  text << std::setprecision(17) << "revision " << report.revision << ", proxy " << r.proxy_m.transpose()
       << ", status " << r.status << ", contacts " << r.contactCount << ", rendered " << r.force_N.transpose()
       << ", written " << report.force_N.transpose() << ", gain " << g.gain << ", limit " << g.limit_N
       << ", trips " << g.active << ' ' << g.latched << ", counts";
  for (const std::uint32_t count : g.counts) text << ' ' << count;
  return text.str();
}

/// One for each device.
inline std::vector<Compared> rerender(const std::filesystem::path& file,
                                      const record::RerenderChanges& changes = {}) {
  record::RecordingReader reader(file);
  record::Rerenderer again(reader.header(), changes);
  std::vector<Compared> devices(reader.header().devices.size());
  for (record::RecordingEvent event; reader.next(event);) {
    const realtime::TickReport* now = again.feed(event);
    if (now == nullptr) continue;
    const auto& [device, tick] = std::get<record::TickEvent>(event);
    Compared& compared = devices[device];
    if (!again.comparable(device)) {
      ++compared.skipped;
      continue;
    }
    ++compared.ticks;
    compared.touching += tick.report.rendering.touching ? 1 : 0;
    compared.stopped += tick.report.guard.stopped ? 1 : 0;
    compared.revisions.insert(tick.report.revision);
    compared.largest_N = std::max(compared.largest_N, (now->force_N - tick.report.force_N).norm());
    compared.largestRendered_N =
        std::max(compared.largestRendered_N, (now->rendering.force_N - tick.report.rendering.force_N).norm());
    if (record::sameOutcome(*now, tick.report)) {
      ++compared.same;
    } else if (compared.firstDifference.empty()) {
      std::ostringstream text;
      text << "tick " << tick.report.tick << ", as recorded and as rendered again:\n"
           << summary(tick.report) << '\n'
           << summary(*now);
      compared.firstDifference = text.str();
    }
  }
  EXPECT_EQ(reader.remark(), "");
  return devices;
}

}  // namespace hapticd::test
