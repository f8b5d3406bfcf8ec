#include "scene/object_checks.h"

#include <algorithm>

#include "geometry/gap_tolerance.h"
#include "geometry/mesh_check.h"
#include "scene/notice.h"

namespace hapticd::scene {
namespace {

constexpr Nanos kCheckAfter = 250'000'000;
constexpr Nanos kSlice = 2'000'000;
constexpr std::uint64_t kWorkBetweenLooks = 50'000;

std::shared_ptr<const std::vector<Vec3f>> latestVertices(const MeshGeometry& geometry) {
  return geometry.target ? geometry.target : geometry.vertices;
}

std::string joined(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : " ") + sentence;
  return text;
}

// Empty where the floats of the vertices are fine enough for the gap tolerance.
std::string describeCoarseFloats(const std::vector<Vec3f>& vertices, double metresPerUnit) {
  double largest = 0;
  for (const Vec3f& v : vertices) largest = std::max(largest, static_cast<double>(v.cwiseAbs().maxCoeff()));
  const double tolerance_m = geometry::fourFloatSteps(largest) * metresPerUnit;
  if (!(tolerance_m > geometry::kLargestGapTolerance_m)) return {};
  return textOf("Coordinates are as large as ", largest, ", where four steps of a float are ",
                tolerance_m * 1e6, " um of the device: a hand may slip through seams with gaps above ",
                geometry::kLargestGapTolerance_m * 1e6,
                " um. Send vertices near the origin of their object, and place the object by its position.");
}

}  // namespace

void MeshChecks::clear() {
  pending_.clear();
  search_.reset();
}

void MeshChecks::add(std::int32_t object, std::uint64_t topology, Nanos now) {
  pending_.push_back({now + kCheckAfter, object, topology});
}

std::vector<MeshChecks::Pending> MeshChecks::waiting() const {
  std::vector<Pending> all;
  if (search_) all.push_back({0, search_->object, search_->topology});
  all.insert(all.end(), pending_.begin(), pending_.end());
  return all;
}

std::optional<Nanos> MeshChecks::due() const {
  if (search_) return 0;
  if (pending_.empty()) return std::nullopt;
  return pending_.front().at;
}

Nanos MeshChecks::run(Nanos now, const Find& find, const Report& report) {
  const Nanos begin = stopwatch_();
  if (search_) {
    if (!find(search_->object, search_->topology)) {
      search_.reset();
    } else if (slice(begin)) {
      const std::string text = joined(geometry::describe(search_->crossings.report()));
      if (!text.empty()) report(search_->object, text);
      search_.reset();
    }
  }
  while (!search_ && !pending_.empty() && pending_.front().at <= now && stopwatch_() - begin <= kSlice) {
    const Pending check = pending_.front();
    pending_.pop_front();
    if (const auto subject = find(check.object, check.topology)) start(check, *subject, begin, report);
  }
  return stopwatch_() - begin;
}

// True when the search is complete.
bool MeshChecks::slice(Nanos begin) {
  while (!search_->crossings.run(kWorkBetweenLooks)) {
    if (stopwatch_() - begin > kSlice) return false;
  }
  return true;
}

// All in one text, unless the search takes longer than a slice.
void MeshChecks::start(const Pending& check, const Subject& subject, Nanos begin, const Report& report) {
  const auto vertices = latestVertices(*subject.geometry);
  const auto& triangles = subject.geometry->triangles;
  std::vector<std::string> sentences = geometry::describe(geometry::checkMesh(*vertices, subject.asSent));
  if (std::string coarse = describeCoarseFloats(*vertices, subject.metresPerUnit); !coarse.empty())
    sentences.push_back(std::move(coarse));
  search_ = Search{check.object, check.topology, vertices, triangles,
                   geometry::CrossingSearch(*vertices, *triangles)};
  if (slice(begin)) {
    for (std::string& sentence : geometry::describe(search_->crossings.report()))
      sentences.push_back(std::move(sentence));
    search_.reset();
  }
  if (!sentences.empty()) report(check.object, joined(sentences));
}

}  // namespace hapticd::scene
