// The mesh of one object while clients edit it, and what of it has been published.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "scene/deformation.h"
#include "scene/last_commands.h"

namespace hapticd::scene {

/// A vector that is copied only when it is written to after it was shared.
template <class T>
class CopyOnWrite {
 public:
  const std::vector<T>& read() const { return shared_ ? *shared_ : own_; }
  /// To write to; `needed` is the size it will have.
  std::vector<T>& write(std::size_t needed) {
    if (shared_) {
      own_.reserve(std::max(needed, shared_->size()));
      own_.assign(shared_->begin(), shared_->end());
      shared_.reset();
    }
    return own_;
  }
  /// To have another content.
  void replace(std::vector<T>&& content) {
    own_ = std::move(content);
    shared_.reset();
  }
  /// To share: what it holds now will not change any more.
  std::shared_ptr<const std::vector<T>> share() {
    if (!shared_) shared_ = std::make_shared<const std::vector<T>>(std::exchange(own_, {}));
    return shared_;
  }

 private:
  std::vector<T> own_;
  std::shared_ptr<const std::vector<T>> shared_;
};

struct RefusedVertices {
  std::size_t count = 0;
  std::size_t number = 0;  ///< of the first, in the run
  Vec3f position;
};

/// Vertices and triangles by number. Runs arrive in any order. A vertex that was never set is NaN, and a
/// triangle with such a corner exerts no force.
class MeshDraft {
 public:
  static constexpr Nanos kPause = 4'000'000;   ///< from the last edit, of positions alone, to its publication
  static constexpr Nanos kQuiet = 20'000'000;  ///< from the last edit of a mesh to its publication
  /// Coordinates in world units: beyond it sizes and normals lose their meaning.
  static constexpr double kLargestCoordinate = 1e12;
  static constexpr Nanos kLongest = 250'000'000;  ///< from the first edit to the publication, at most
  static constexpr Nanos kLongestMorph = 50'000'000;
  static constexpr Nanos kLongestGap = 100'000'000;  ///< between shapes; beyond, no interval is measured
  static constexpr Nanos kUnmeasured = 16'000'000;   ///< duration of a morph without an interval

  std::size_t vertexCount() const { return vertices_.read().size(); }
  /// Numbered triangles; triples when there are none.
  std::size_t triangleCount() const { return indexed_ ? triangles_.read().size() : vertexCount() / 3; }
  bool indexed() const { return indexed_; }
  /// As numbered by the client: removed ones and missing corners have vertex numbers that do not exist.
  const std::vector<Triangle>& triangles() const { return triangles_.read(); }

  /// Writes a run; values that are not finite or beyond kLargestCoordinate leave their vertex as it
  /// was. Returns how many those were, and the first of them.
  RefusedVertices setVertices(std::uint32_t first, std::vector<Vec3f>&& run, Nanos now);
  void setTriangles(std::uint32_t first, const std::vector<Triangle>& run, Nanos now);
  /// False when there is no such triangle.
  bool removeTriangle(std::uint32_t triangle, Nanos now);
  void clear(Nanos now);
  /// The mesh is complete: publish it at the next call.
  void finish() { finished_ = true; }

  /// Does not publish the edits so far until the next edit.
  void giveUp() { dirty_ = false; }

  /// Appends commands that make an empty draft this one, as it was published if only positions have changed
  /// since. Those of other edits under way have their times.
  void appendCommands(std::int32_t object, ClientId client, bool inMetres,
                      std::vector<ClientCommand>& out) const;
  /// Appends the commands, with their times, that make the published draft this one.
  void appendEditsUnderWay(std::int32_t object, ClientId client, std::vector<ClientCommand>& out) const;
  /// What ContinueMesh says.
  void continueFrom(bool hasDeformed, bool wasPublished, std::optional<Nanos> firstEdit, Nanos now);

  bool finished() const { return finished_; }
  /// When edits should be published; nothing when there are none.
  std::optional<Nanos> due() const;
  /// The oldest edit that is not published yet; nothing when there is none.
  std::optional<Nanos> oldestEdit() const { return dirty_ ? std::optional(firstEdit_) : std::nullopt; }
  bool hasBeenPublished() const { return current_ != nullptr || wasPublished_; }

  /// Builds the mesh with all edits; null when it has no triangles. `topology` numbers a new list of
  /// triangles; no other mesh has it. begin() must follow.
  std::shared_ptr<const MeshGeometry> commit(Nanos now, std::uint64_t topology, bool ballTool);
  /// How long the surface of commit() should travel to its shape from `begin` on, when it travels
  /// `shortest(distance in object units)` at least; 0: it is a new one.
  Nanos travel(Nanos begin, const std::function<Nanos(double)>& shortest) const;
  /// After commit(), and before the servo may see it: it travels from what is rendered at `begin`.
  void begin(Nanos begin, Nanos travel);

 private:
  void edited(Nanos now);
  void shapeEdited(Nanos now);
  bool positionsAreUnderWay() const { return dirty_ && !shapeChanged_ && current_; }
  void grow(std::vector<Vec3f>& vertices, std::size_t size);
  std::shared_ptr<const std::vector<Triangle>> shareTriangles();
  std::shared_ptr<MeshGeometry> build(std::uint64_t topology, bool ballTool);

  CopyOnWrite<Vec3f> vertices_;
  CopyOnWrite<Triangle> triangles_;  // as sent: corners may be missing
  bool indexed_ = false;
  std::size_t missing_ = 0;  // vertices before the last one that have not come yet
  bool dirty_ = false;
  bool shapeChanged_ = false;  // more than positions
  bool finished_ = false;
  bool hasDeformed_ = false;   // since the triangles were set
  bool wasPublished_ = false;  // with other triangles, before the recording that this draft continues
  Nanos firstEdit_ = 0;
  Nanos lastEdit_ = 0;
  Nanos lastCommit_ = 0;
  std::shared_ptr<MeshGeometry> current_;
  Deformation deformation_;  // to the shapes after it
};

}  // namespace hapticd::scene
