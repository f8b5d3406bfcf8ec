// The editable objects of a scene: a tree of placements with meshes and surfaces.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "scene/commands.h"
#include "scene/config.h"
#include "scene/description.h"
#include "scene/last_commands.h"
#include "scene/matrices.h"
#include "scene/mesh_draft.h"
#include "scene/notice_board.h"
#include "scene/object_checks.h"
#include "scene/snapshot.h"
#include "scene/surface_settings.h"

namespace hapticd::scene {

/// Measures the interval of the poses of an object: the duration of the movement to each.
struct PoseStream {
  static constexpr Nanos kSameMoment = 500'000;      ///< parts of one pose
  static constexpr Nanos kLongestGap = 100'000'000;  ///< beyond, no interval is measured
  static constexpr Nanos kLongestBlend = 50'000'000;
  static constexpr Nanos kUnmeasured = 16'000'000;  ///< without an interval

  /// Call with each pose. Returns the duration of the movement to it.
  Nanos next(Nanos now);

 private:
  bool any_ = false;
  Nanos last_ = 0;
  Nanos interval_ = 0;
  Nanos blend_ = kUnmeasured;
};

/// Where an object was in the last 100 to 200 ms. A late tick looks for it there.
class Trail {
 public:
  void add(const Box& swept, Nanos now);
  /// Box around all; empty when the object rested.
  Box around(Nanos now) const;
  void clear() { *this = {}; }

 private:
  static constexpr Nanos kLength = 100'000'000;
  Box recent_;
  Box older_;
  Nanos begin_ = 0;
};

/// One object as clients see it.
struct Object {
  static constexpr std::int32_t kScene = -1;     ///< parent: below the scene's origin
  static constexpr std::int32_t kNoParent = -2;  ///< parent: a root of its own

  std::int32_t id = 0;
  std::size_t gap = 0;    ///< its part of ObjectTable::gaps_
  bool inMetres = false;  ///< stock geometry: one object unit is 1000 world units
  bool touchable = true;
  std::string name;  ///< for people
  std::int32_t parent = kScene;
  std::vector<std::int32_t> children;

  Affine T_parent_object = Affine::Identity();  ///< translation in object units
  geometry::Quat rotation = geometry::Quat::Identity();
  Vec3 scale = Vec3::Ones();
  Affine T_object_mesh = Affine::Identity();
  PoseStream poses;

  MeshDraft mesh;
  ClientId meshSetBy = 0;
  SurfaceSettings settings;
  ClientId surfaceSetBy = 0;
  LastCommands asked;  ///< all but the tree and the mesh

  // The published part, and what of it is out of date.
  std::shared_ptr<const MeshGeometry> geometry;
  Surface surface;
  double surfaceLoad_Ns_per_m = 0;  ///< of the passivity bound, alone
  std::string surfaceRemark;
  Motion motion;
  Trail trail;
  std::shared_ptr<const ObjectState> state;
  bool queued = false;      ///< in the table's list of changed ones
  bool meshQueued = false;  ///< in its list of edited meshes
  bool stateChanged = true;
  bool surfaceChanged = false;
  bool moved = false;
  bool movePending = false;    ///< it and its descendants move, which publish() works out
  Nanos pendingTravel = 0;     ///< of that move
  Nanos travel = 0;            ///< shortest duration of the pending move; 0 is a jump
  std::int64_t position = -1;  ///< in the published list

  double worldUnits() const { return inMetres ? 1000 : 1; }
  bool isTouchable() const {
    return touchable && geometry && geometry->index.size() > 0 && !geometry->index.bounds().empty() &&
           surface.stiffness_N_per_m > 0;
  }
};

/// The part of a snapshot that objects make up; unchanged parts are shared with the previous snapshot.
struct PublishedObjects {
  std::vector<std::shared_ptr<const ObjectState>> objects;
  std::shared_ptr<const SpatialIndex> index;
  /// Nothing moves or deforms any more, and earlier intervals do not count for the next movement.
  Nanos settledAt = 0;
};

/// All objects by id. A command checks all of its values before it changes anything.
class ObjectTable {
 public:
  explicit ObjectTable(const SceneConfig& config);

  /// Executes a command whose target is Target::objects.
  void apply(SceneCommand& command, const Call& call);

  /// Object 0 alone, empty.
  void reset();

  std::optional<Nanos> nextDeadline() const;
  /// The oldest edit of a mesh that is not published yet.
  std::optional<Nanos> oldestEdit() const;
  /// Brings `published` up to date; false when nothing changed. Remarks on a surface go to the client that
  /// set it. The scale of the workspace gives speeds in metres. Surfaces are lowered to stay within the
  /// passivity bound together with the free forces, whose load is given.
  bool publish(Nanos now, double worldUnitsPerMetre, double freeLoad_Ns_per_m, NoticeBoard& board,
               std::vector<Notice>& out);
  const PublishedObjects& published() const { return published_; }
  /// The largest load of the passivity bound among the published surfaces, each alone.
  double heaviestSurface_Ns_per_m() const { return heaviestSurface_Ns_per_m_; }
  /// Appends every object, whether it exerts force or not.
  void describe(SceneDescription& out) const;
  /// Appends commands that make an empty table this one.
  void appendCommands(std::vector<ClientCommand>& out) const;
  void appendEditsUnderWay(Nanos now, std::vector<ClientCommand>& out) const;

 private:
  // One specialisation for each command, in object_commands.cpp; a missing one does not link.
  template <class Command>
  void handle(Command& command, const Call& call);

  Object* find(std::int32_t id) const;
  Object* find(std::int32_t id, std::string_view name, const Call& call) const;
  void create(std::int32_t id, std::int32_t parent);
  void erase(std::int32_t id);
  void attach(Object& object, std::int32_t parent);
  void detach(Object& object);
  bool checkParent(std::int32_t id, std::int32_t parent, std::string_view name, const Call& call) const;
  std::int32_t depth(std::int32_t id) const;
  std::int32_t height(const Object& object) const;
  template <class F>
  void withDescendants(Object& object, const F& f);

  /// For how many of a run of vertices or triangles there is room; refuses the others.
  std::size_t roomFor(Object& object, std::int64_t first, std::size_t count, std::size_t present,
                      std::uint32_t perObject, std::uint64_t inAll, std::uint64_t used, std::string_view name,
                      std::string_view what, const Call& call);
  std::size_t roomForTriples(const Object& object, const SetVertices& c, std::string_view name,
                             const Call& call) const;
  void setTriangles(Object& object, std::int64_t first, std::vector<Triangle> run, bool makesMetres,
                    const Call& call);
  void closeGap(Object& object, std::size_t count);
  void becomeStock(Object& object);
  void place(Object& object, const Affine& T_parent_object, const Call& call);
  void moveAll(Object& object, Nanos travel);
  void moveScene(Nanos travel);
  void spreadMoves();
  void queue(Object& object);
  void meshEdited(Object& object, const Call& call);

  /// World from the object's frame, measured in world units; the chain of parents without a mesh's own part.
  Affine frameOf(const Object& object) const;
  void commitMeshes(Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  double metresPerUnit(const Object& object) const;
  void commitMesh(Object& object, Nanos now, Nanos clock, std::vector<Object*>& committed);
  void beginMorphs(const std::vector<Object*>& committed, Nanos begin);
  void checkMeshes(Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  struct Move {
    Object* object = nullptr;
    Affine from;
    Affine to;
    Box bounds;  // of its mesh
    Nanos travel = 0;
    std::size_t leader = 0;  // number of the move that it follows, or its own
  };
  std::optional<Move> moveOf(Object& object, const Call& call);
  void updateMotions(Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  void unsettle(Nanos now);
  void spreadFreeLoad(double load_Ns_per_m);
  void updateHeaviest();
  void updateSurface(Object& object, Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  bool updatePublished(Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  void replaceState(Object& object, Nanos now);
  void rebuildList(Nanos now);
  void rebuildIndex();

  const SceneConfig& config_;
  PassivityBound bound_;
  std::function<Nanos()> stopwatch_;
  std::function<Nanos()> clock_;
  std::vector<std::unique_ptr<Object>> objects_;
  Affine T_world_scene_ = Affine::Identity();
  LastCommands asked_;  // of the scene's origin
  PoseStream scenePoses_;
  double worldUnitsPerMetre_ = 1000;
  double freeLoad_Ns_per_m_ = 0;  // of the forces that belong to no object
  std::uint64_t vertices_ = 0;
  std::size_t gaps_ = 0;  // numbers below large gaps that were not sent yet, of all objects
  std::uint64_t triangles_ = 0;
  std::uint64_t lastTopology_ = 0;  // one counter for all meshes: no number is used twice
  std::uint32_t jumps_ = 0;         // one counter for all: no number is used twice

  std::vector<std::int32_t> moves_;   // objects with movePending
  std::optional<Nanos> sceneTravel_;  // of the pending move of the scene's origin
  std::vector<std::int32_t> changed_;
  std::vector<std::int32_t> edited_;  // meshes with edits
  Nanos rebuildNotBefore_ = 0;
  MeshChecks checks_;  // of new shapes
  bool listChanged_ = true;
  double heaviestSurface_Ns_per_m_ = 0;
  bool indexStale_ = true;

  PublishedObjects published_;
  std::vector<Box> boxes_;  // of the index: with room to move
};

}  // namespace hapticd::scene
