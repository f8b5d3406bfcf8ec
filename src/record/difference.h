// The difference between a recording and its re-rendering, and a report of it for people.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "record/recording.h"
#include "record/rerender.h"

namespace hapticd::record {

/// One tick as recorded and as re-rendered.
struct DifferencePoint {
  double time_s = 0;  ///< since the first tick of the device
  double force_N = 0;
  double forceNow_N = 0;
  double depth_m = 0;  ///< 0 when free
  double depthNow_m = 0;
};

/// The difference of one device over all ticks.
class Difference {
 public:
  explicit Difference(std::string device) : device_(std::move(device)) {}

  void add(const realtime::TickReport& then, const realtime::TickReport& now);
  void add(const LostEvent& lost);
  /// A tick before the recording can be compared.
  void skip() { ++skipped_; }
  void setKnowsPast(bool known) { knowsPast_ = known; }

  const std::string& device() const noexcept { return device_; }
  std::uint64_t ticks() const noexcept { return points_.size(); }
  /// Ticks that agree in every bit of rendering, force and guard.
  std::uint64_t same() const noexcept { return same_; }
  /// Ticks that the recorder dropped; the ticks after them may differ.
  std::uint64_t lost() const noexcept { return lost_; }
  /// False: ticks, scene events or streamed values are missing.
  bool complete() const noexcept { return complete_; }
  /// Ticks before a recording that began while the server ran can be compared.
  std::uint64_t skipped() const noexcept { return skipped_; }
  /// False: the recording began while the server ran, without what its servo knew.
  bool knowsPast() const noexcept { return knowsPast_; }
  std::uint64_t touching() const noexcept { return touching_; }  ///< in either of the two
  /// The norm of the largest difference of the two forces.
  double largest_N() const noexcept { return largest_N_; }
  double largestAt_s() const noexcept { return largestAt_s_; }
  /// Mean over the ticks that touch in either; over all ticks when none does.
  double mean_N() const noexcept;
  double largestDepth_m() const noexcept { return largestDepth_m_; }
  double meanDepth_m() const noexcept;
  const std::vector<DifferencePoint>& points() const noexcept { return points_; }

 private:
  double shareOf(double sum) const noexcept;

  std::string device_;
  std::vector<DifferencePoint> points_;
  Nanos begin_ = 0;
  std::uint64_t same_ = 0;
  std::uint64_t lost_ = 0;
  bool complete_ = true;
  std::uint64_t skipped_ = 0;
  bool knowsPast_ = true;
  std::uint64_t touching_ = 0;
  double largest_N_ = 0;
  double largestAt_s_ = 0;
  double sum_N_ = 0;
  double largestDepth_m_ = 0;
  double sumDepth_m_ = 0;
};

/// "the recording has force law 1, this program law 15"; empty when they agree.
std::string lawDifference(const RecordingHeader& header);

/// Re-renders a whole recording. `remark` says what is missing, if anything is. Throws RecordingError.
/// `law` is the lawDifference() of the recording.
std::vector<Difference> compare(const std::filesystem::path& session, const RerenderChanges& changes,
                                std::string& remark, std::string& law);

/// The changes for a headline: "stiffness 300 N/m, tool radius 2 mm"; "nothing".
std::string describe(const RerenderChanges& changes);

/// A self-contained page with the figures and with plots of force and depth over time, recorded and
/// re-rendered.
std::string htmlReport(const std::string& session, const RerenderChanges& changes,
                       const std::vector<Difference>& devices, const std::string& remark);

}  // namespace hapticd::record
