// Tells clients what is wrong with a mesh, once it has been the same for a while.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/crossings.h"
#include "scene/mesh_geometry.h"

namespace hapticd::scene {

/// Meshes that wait for their check, and the one that is being searched for crossing triangles, a slice of a
/// few milliseconds at a time so that commands never wait for it.
class MeshChecks {
 public:
  using Stopwatch = std::function<Nanos()>;

  /// A mesh as it should be checked.
  struct Subject {
    std::shared_ptr<const MeshGeometry> geometry;
    /// Triangles as the client numbers them, of which some may lack corners.
    std::span<const Triangle> asSent;
    double metresPerUnit = 1;  ///< of its coordinates, in the device frame
  };
  /// The mesh of an object while its shape is that topology; nothing when it has changed or gone.
  using Find = std::function<std::optional<Subject>(std::int32_t object, std::uint64_t topology)>;
  /// Takes the sentences about an object's mesh.
  using Report = std::function<void(std::int32_t object, const std::string& text)>;

  /// A mesh that waits for its check.
  struct Pending {
    Nanos at = 0;
    std::int32_t object = 0;
    std::uint64_t topology = 0;
  };

  explicit MeshChecks(Stopwatch stopwatch) : stopwatch_(std::move(stopwatch)) {}

  void clear();
  /// A shape has come: it is due after it has been left alone for a while, so that half an upload is not
  /// called open.
  void add(std::int32_t object, std::uint64_t topology, Nanos now);
  /// After those that wait already.
  void wait(const Pending& check) { pending_.push_back(check); }
  /// Those that wait, by time; first the one that is being searched, which is due at once.
  std::vector<Pending> waiting() const;
  /// When there is something to do; nothing when not.
  std::optional<Nanos> due() const;
  /// Goes on with what is due at `now`; returns the time it took.
  Nanos run(Nanos now, const Find& find, const Report& report);

 private:
  struct Search {
    std::int32_t object = 0;
    std::uint64_t topology = 0;
    std::shared_ptr<const std::vector<Vec3f>> vertices;  // lent to the search
    std::shared_ptr<const std::vector<Triangle>> triangles;
    geometry::CrossingSearch crossings;
  };

  bool slice(Nanos begin);
  void start(const Pending& check, const Subject& subject, Nanos begin, const Report& report);

  Stopwatch stopwatch_;
  std::deque<Pending> pending_;  // by time
  std::optional<Search> search_;
};

}  // namespace hapticd::scene
