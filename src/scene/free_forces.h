// Forces that belong to no object: effects, planes, force fields, constraints, the buzz. Each is owned by the
// client that last set or started it and ramps out when that client leaves. What somebody sets meanwhile
// replaces nothing of it.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "scene/commands.h"
#include "scene/config.h"
#include "scene/description.h"
#include "scene/effect.h"
#include "scene/force_field.h"
#include "scene/last_commands.h"
#include "scene/notice_board.h"
#include "scene/passivity.h"
#include "scene/plane.h"

namespace hapticd::scene {

/// The part of a snapshot that they make up.
struct PublishedForces {
  std::vector<Effect> effects;
  std::vector<Plane> planes;
  std::vector<ForceField> fields;
  std::optional<Buzz> buzz;
};

/// One of them, and whose it is. At namespace level, as is what follows: clang refuses a std::optional of a
/// nested class with default member initialisers inside the class around it.
template <class T>
struct OwnedForce {
  static constexpr Nanos kNever = std::numeric_limits<Nanos>::max();

  ClientId owner = 0;
  T value;
  Nanos goneAt = kNever;       ///< when it has ended or ramped out
  bool outOfWorld = false;     ///< ramps out since a reset ended its world: stays on the device
  Nanos untoldSince = kNever;  ///< no snapshot has its start or its ramp yet; kNever: one has

  /// Of a force that started, or ramps out from now on.
  void endAt(Nanos at, Nanos now) {
    goneAt = at;
    untoldSince = std::min(untoldSince, now);
  }
  /// Not before a publication has told of it, unless the one after `since` failed.
  bool isGone(Nanos now, Nanos since) const {
    return now >= goneAt && (untoldSince == kNever || untoldSince < since);
  }
};

struct RunningEffect {
  Effect effect;
  DefineEffect asked;  ///< what defined it
  bool running = false;
  Nanos startedAt = 0;
};

struct ForceConstraint {
  bool enabled = false;
  std::int32_t mode = 0;
  Vec3 point_m = Vec3::Zero();
  Vec3 linePoint_m = Vec3::Zero();
  Vec3 lineDirection = Vec3::UnitZ();
  Vec3 planePoint_m = Vec3::Zero();
  Vec3 planeNormal = Vec3::UnitY();
  double stiffness_N_per_m = 1000;
  std::uint32_t number = 0;  // of the field that it becomes
  bool releasing = false;
  std::shared_ptr<const ForceOwner> owner;
};

/// To what share a field was lowered, as its owner was told.
struct FieldShare {
  std::uint32_t number = 0;  ///< of the field
  long stiffness_percent = 100;
  long force_percent = 100;

  bool operator==(const FieldShare&) const = default;
};

/// The same of a plane, and who was told.
struct PlaneShare {
  ClientId owner = 0;
  long percent = 100;

  bool operator==(const PlaneShare&) const = default;
};

/// All of them, by index. A command checks all of its values before it changes anything.
class FreeForces {
 public:
  explicit FreeForces(const SceneConfig& config);

  /// Executes a command whose target is Target::forces.
  void apply(SceneCommand& command, const Call& call);

  /// The forces that the client owns ramp out and are removed.
  void clientGone(ClientId client, Nanos now);
  /// All forces ramp out and are removed, on behalf of this client.
  void reset(ClientId client, Nanos now);
  /// The view changes: what ramps out since a reset stays where it is on the device, as it would pull
  /// elsewhere, or reach the hand anew. `motion` is from the world of the view before to that of the new one.
  void keepResetInPlace(const Affine& motion);

  std::optional<Nanos> nextDeadline() const;
  /// Removes ended forces and reports startEffect calls whose definition never arrived. True when something
  /// changed since the last call.
  bool update(Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  /// What the effects and fields take of the passivity bound, in N s/m.
  double load_Ns_per_m(double worldUnitsPerMetre) const;
  /// Force fields depend on the workspace: a stiff one is kept passive in device metres, and its owner is
  /// told. Effects and fields are lowered to stay within the passivity bound together with the planes and
  /// with the surfaces of objects, of which the largest load is given, and planes beside them.
  PublishedForces publish(Nanos now, double worldUnitsPerMetre, double heaviestSurface_Ns_per_m,
                          NoticeBoard& board, std::vector<Notice>& out);
  /// Appends all of them, running or not.
  void describe(SceneDescription& out) const;
  /// Appends commands that set and start all but those that ramp out; effects go on.
  void appendCommands(Nanos now, std::vector<ClientCommand>& out) const;

 private:
  // One specialisation for each command, in free_force_commands.cpp; a missing one does not link.
  template <class Command>
  void handle(Command& command, const Call& call);

  template <class T>
  using Owned = OwnedForce<T>;
  using Constraint = ForceConstraint;
  static constexpr double kWorldUnitsPerStockMetre = 1000;
  static constexpr Nanos kNever = std::numeric_limits<Nanos>::max();
  static constexpr Nanos kRelease = 300'000'000;  ///< ramping out takes 250 ms in the servo
  static constexpr std::size_t kMostReleasing = kMaxEffects + kMostOfEarlierReset;  ///< effects
  static constexpr Nanos kAfterEnd = 50'000'000;     ///< the servo ends a timed force by its own clock
  static constexpr Nanos kRemember = 1'000'000'000;  ///< a start whose definition has not arrived yet

  std::shared_ptr<const ForceOwner> ownerOf(ClientId client) const {
    return config_.owners ? config_.owners->of(client) : nullptr;
  }
  void start(Owned<RunningEffect>& entry, ClientId client, Nanos at, Nanos untoldSince);
  void start(std::int32_t index, Nanos at, Nanos untoldSince, const Call& call);
  void beginInServo(Nanos now);
  template <class F>
  void release(const F& whose, Nanos now, bool endsWorld);
  std::size_t countEffects(bool releasing) const;
  void boundReleasingEffects();
  template <class F>
  void forEachForce(const F& f);
  template <class F>
  void forEachDeadline(const F& f) const;
  std::optional<ForceField> fieldOf(const Constraint& constraint) const;
  ForceField passive(ForceField field, double worldUnitsPerMetre) const;
  std::vector<ForceField> passiveFields(double worldUnitsPerMetre) const;
  double loadWith(const std::vector<ForceField>& fields, double worldUnitsPerMetre) const;
  SpringSum sumOfEffects() const;
  void tellOfEffects(Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  void tellOfDetail(double worldUnitsPerMetre, Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  double shareTogether(double load_Ns_per_m) const;
  void keepPassiveTogether(PublishedForces& forces, double worldUnitsPerMetre);
  void tellOfFields(const PublishedForces& forces, double worldUnitsPerMetre, Nanos now, NoticeBoard& board,
                    std::vector<Notice>& out);
  void tellOfPlanes(const PublishedForces& forces, Nanos now, NoticeBoard& board, std::vector<Notice>& out);
  Constraint& constraintFor(const Call& call);
  void letFieldLeave();

  const SceneConfig& config_;
  PassivityBound bound_;
  std::map<std::int32_t, Owned<RunningEffect>> effects_;
  std::map<std::int32_t, Owned<char>> waitingStarts_;
  std::map<std::int32_t, Owned<Plane>> planes_;
  std::optional<Owned<Plane>> planeDetail_;  // of plane 0, even while that does not exist
  std::optional<Owned<ForceField>> field_;
  std::optional<Owned<Constraint>> constraint_;
  std::optional<Owned<Buzz>> buzz_;
  // What still ramped out when somebody set another in its place.
  std::vector<Owned<Effect>> leavingEffects_;
  std::vector<Owned<ForceField>> leavingFields_;
  std::uint32_t starts_ = 0;        // one counter for all: no number is used twice
  std::uint32_t placements_ = 0;    // the same for planes
  std::uint32_t fieldNumbers_ = 0;  // the same for fields
  LastCommands asked_;              // of all but effects, also of forces that are gone
  LastCommands askedOfConstraint_;
  const std::function<Nanos()> stopwatch_;
  Nanos updatedAt_ = 0;
  double heaviestSurface_Ns_per_m_ = 0;  // of objects, when last published
  double worldUnitsPerMetre_ = 1000;     // then
  double share_ = 1;                     // then, of what does not ramp out
  // What to tell at the next publication, when all that comes together is known.
  std::set<ClientId> tellOfSum_;  // whose effects started or changed
  bool tellOfDetail_ = false;
  FieldShare fieldTold_;
  FieldShare constraintTold_;
  std::array<PlaneShare, kMaxPlanes> planesTold_;  // by index
  bool changed_ = false;
};

}  // namespace hapticd::scene
