#include "scene/builder.h"

#include <algorithm>
#include <map>
#include <new>
#include <utility>

#include "scene/free_forces.h"
#include "scene/held_commands.h"
#include "scene/notice_board.h"
#include "scene/object_table.h"
#include "scene/surface_settings.h"
#include "scene/workspace_fit.h"

namespace hapticd::scene {
namespace {

// Before a description by commands: so that its meshes need not wait for further edits, and its movements are
// over and measure no interval from it.
constexpr Nanos kSettled = 500'000'000;

void sortByTime(std::vector<ClientCommand>& commands) {
  std::stable_sort(commands.begin(), commands.end(),
                   [](const ClientCommand& a, const ClientCommand& b) { return a.at < b.at; });
}

}  // namespace

class SceneBuilder::State {
 public:
  explicit State(SceneConfig config) : config_(std::move(config)), objects_(config_), forces_(config_) {
    resetWorkspace();
  }

  void take(SceneCommand&& command, const Call& call) {
    const auto open = batches_.find(call.client);
    if (open == batches_.end() || std::holds_alternative<BeginBatch>(command) ||
        std::holds_alternative<CommitBatch>(command) || std::holds_alternative<RefuseBatch>(command) ||
        std::holds_alternative<ReleaseForces>(command)) {
      dispatch(command, call);
      return;
    }
    Batch& batch = open->second;
    if (batch.refused) return;
    const std::size_t bytes = bytesOf(command);
    if (heldInBatches_ + bytes > config_.limits.batch_bytes) {
      refuse(batch);
      call.refuse("batch", "refused as a whole: too long; commit more often", ", limit ",
                  config_.limits.batch_bytes, " bytes");
      return;
    }
    try {
      batch.commands.push(std::move(command));
    } catch (const std::bad_alloc&) {
      refuse(batch);
      call.refuse("batch", "refused as a whole: ", kOutOfMemory);
      return;
    }
    batch.bytes += bytes;
    heldInBatches_ += bytes;
  }

  void clientGone(ClientId client, Nanos now) {
    if (const auto batch = batches_.extract(client)) heldInBatches_ -= batch.mapped().bytes;
    board_.forget(client);
    forces_.clientGone(client, now);
  }

  std::optional<Nanos> nextDeadline() const {
    std::optional<Nanos> next;
    for (const auto& at : {board_.nextDeadline(), objects_.nextDeadline(), forces_.nextDeadline()}) {
      if (at) next = std::min(next.value_or(*at), *at);
    }
    return next;
  }

  std::optional<Nanos> oldestEdit() const { return objects_.oldestEdit(); }

  std::shared_ptr<const SceneSnapshot> publish(Nanos now, std::vector<Notice>& out) {
    board_.flush(now, out);
    const bool forces = forces_.update(now, board_, out);
    const double units = workspace_.worldUnitsPerMetre;
    const bool objects = objects_.publish(now, units, forces_.load_Ns_per_m(units), board_, out);
    if (!forces && !objects && !changed_) return nullptr;
    changed_ = false;
    auto snapshot = std::make_shared<SceneSnapshot>();
    snapshot->revision = ++revision_;
    snapshot->workspace = workspace_;
    snapshot->faces = faces_;
    snapshot->objects = objects_.published().objects;
    snapshot->objectIndex = objects_.published().index;
    snapshot->settledAt = objects_.published().settledAt;
    PublishedForces published = forces_.publish(now, units, objects_.heaviestSurface_Ns_per_m(), board_, out);
    snapshot->effects = std::move(published.effects);
    snapshot->planes = std::move(published.planes);
    snapshot->fields = std::move(published.fields);
    snapshot->buzz = published.buzz;
    return snapshot;
  }

  SceneDescription describe() const {
    SceneDescription description;
    description.revision = revision_;
    description.workspace = workspace_;
    description.faces = faces_;
    description.surfaceAtOne = SurfaceSettings::atOne(config_);
    description.contactVibrationUnit = config_.contactVibrationUnit;
    objects_.describe(description);
    forces_.describe(description);
    return description;
  }

  std::vector<ClientCommand> commands(Nanos now) const {
    std::vector<ClientCommand> commands;
    asked_.appendTo(commands);
    objects_.appendCommands(commands);
    forces_.appendCommands(now, commands);
    for (const auto& [client, batch] : batches_) {
      commands.push_back({client, BeginBatch{}});
      if (batch.refused) commands.push_back({client, RefuseBatch{}});
      batch.commands.forEach([&](const SceneCommand& command) {
        commands.push_back({client, command, now});
      });
    }
    for (ClientCommand& c : commands) {
      const Nanos before = targetOf(c.command) == Target::objects ? now - kSettled : now;
      c.at = std::max(c.at, before);
    }
    sortByTime(commands);
    return commands;
  }

  std::vector<ClientCommand> editsUnderWay(Nanos now) const {
    std::vector<ClientCommand> commands;
    objects_.appendEditsUnderWay(now, commands);
    sortByTime(commands);
    return commands;
  }

  std::uint64_t revision() const noexcept { return revision_; }
  std::optional<std::uint64_t> revisionWith(Nanos edits) const noexcept {
    const std::optional<Nanos> oldest = oldestEdit();
    return !oldest || *oldest > edits ? std::optional(revision_) : std::nullopt;
  }
  std::uint64_t resets() const noexcept { return resets_; }
  const std::shared_ptr<ForceOwners>& owners() const noexcept { return config_.owners; }
  NoticeBoard& board() { return board_; }

 private:
  struct Batch {
    HeldCommands commands;
    std::size_t bytes = 0;
    bool refused = false;  ///< with all that follows until the commit
  };

  void refuse(Batch& batch) {
    batch.refused = true;
    batch.commands.clear();
    heldInBatches_ -= std::exchange(batch.bytes, 0);
  }

  void dispatch(SceneCommand& command, const Call& call) {
    std::visit(
        [&]<class C>(C& c) {
          if constexpr (C::kInfo.target == Target::objects) {
            objects_.apply(command, call);
          } else if constexpr (C::kInfo.target == Target::forces) {
            forces_.apply(command, call);
          } else {
            apply(c, call);
          }
        },
        command);
  }

  void apply(SetTouchableFaces& c, const Call&) {
    asked_.keep(c);
    faces_ = c.faces == 0   ? TouchableFaces::front
             : c.faces == 1 ? TouchableFaces::back
                            : TouchableFaces::both;
    changed_ = true;
  }

  void apply(SetWorkspaceProjection& c, const Call& call) {
    if (!use(fitProjection(c.model, c.projection, config_.deviceWorkspace_m, config_.workspaceFit),
             "setWorkspaceProjectionMatrix", call)) {
      return;
    }
    asked_.drop<SetWorkspaceBox>();
    asked_.keep(c);
  }
  void apply(SetWorkspaceBox& c, const Call& call) {
    if (!use(fitBox(c.model, c.box, config_.deviceWorkspace_m, config_.workspaceFit),
             "setWorkspaceBoundingBox", call)) {
      return;
    }
    asked_.drop<SetWorkspaceProjection>();
    asked_.keep(c);
  }
  bool use(const FittedWorkspace& fitted, std::string_view name, const Call& call) {
    if (!fitted.T_world_device) {
      call.refuse(name, "refused, the old map stays: " + fitted.refusal, fitted.values);
      return false;
    }
    if (!fitted.warning.empty()) call.warn(name, fitted.warning);
    T_world_device_ = *fitted.T_world_device;
    T_scene_haptic_ = Affine::Identity();
    hapticScale_ = 1;
    updateWorkspace();
    return true;
  }

  void apply(SetHapticOrigin& c, const Call& call) {
    const auto rotation = rotationFrom(c.axis, c.angle_rad);
    if (!rotation || !isUsable(c.position_m)) {
      call.refuse("setHapticOrigin", "refused: not finite or too large, or the axis is zero", " position ",
                  c.position_m.transpose(), ", axis ", c.axis.transpose(), ", angle ", c.angle_rad);
      return;
    }
    asked_.keep(c);
    T_scene_haptic_ = Eigen::Translation3d(1000 * c.position_m) * *rotation;
    updateWorkspace();
  }
  void apply(SetHapticScale& c, const Call& call) {
    if (!(c.scale > 1e-9 && c.scale < 1e9)) {
      call.refuse("setHapticScale", "refused: use a positive number between 1e-9 and 1e9", " ", c.scale);
      return;
    }
    asked_.keep(c);
    hapticScale_ = c.scale;
    updateWorkspace();
  }
  void updateWorkspace() {
    const Affine T_device_before = workspace_.T_device_world;
    workspace_ =
        workspaceFrom(T_scene_haptic_ * Eigen::UniformScaling<double>(hapticScale_) * T_world_device_);
    forces_.keepResetInPlace(workspace_.T_world_device * T_device_before);
    changed_ = true;
  }
  void resetWorkspace() {
    asked_.clear();
    T_world_device_ = Workspace().T_world_device;
    T_scene_haptic_ = Affine::Identity();
    hapticScale_ = 1;
    faces_ = TouchableFaces::both;
    updateWorkspace();
  }

  void apply(ResetScene&, const Call& call) {
    forces_.reset(call.client, call.now);  // before the view, which they stay out of
    resetWorkspace();
    objects_.reset();
    ++resets_;
  }

  void apply(BeginBatch&, const Call& call) {
    if (!batches_.try_emplace(call.client).second)
      call.warn("begin of batch", "ignored: the batch is open already");
  }
  void apply(RefuseBatch&, const Call& call) {
    const auto open = batches_.find(call.client);
    if (open != batches_.end()) refuse(open->second);
  }
  void apply(CommitBatch&, const Call& call) {
    auto batch = batches_.extract(call.client);
    if (!batch) {
      call.warn("commit of batch", "ignored: no batch was begun");
      return;
    }
    heldInBatches_ -= batch.mapped().bytes;
    const Call inside{call.client, call.now, true, call.board, call.out};
    batch.mapped().commands.forEach([&](SceneCommand& command) {
      try {
        dispatch(command, inside);
      } catch (const std::bad_alloc&) {
        call.refuse("batch", "carried out in part: ", kOutOfMemory, "; send the scene again");
      }
    });
  }

  const SceneConfig config_;
  NoticeBoard board_;
  ObjectTable objects_;
  FreeForces forces_;
  Affine T_world_device_;
  Affine T_scene_haptic_;
  double hapticScale_ = 1;
  Workspace workspace_;
  TouchableFaces faces_ = TouchableFaces::both;
  LastCommands asked_;  // of the map and the faces
  std::map<ClientId, Batch> batches_;
  std::size_t heldInBatches_ = 0;  // bytes, of all open batches
  std::uint64_t revision_ = 0;
  std::uint64_t resets_ = 0;
  bool changed_ = true;
};

SceneBuilder::SceneBuilder(SceneConfig config) : state_(std::make_unique<State>(std::move(config))) {}
SceneBuilder::~SceneBuilder() = default;
SceneBuilder::SceneBuilder(SceneBuilder&&) noexcept = default;
SceneBuilder& SceneBuilder::operator=(SceneBuilder&&) noexcept = default;

void SceneBuilder::apply(ClientId client, SceneCommand&& command, Nanos now, std::vector<Notice>& notices) {
  state_->take(std::move(command), Call{client, now, false, state_->board(), notices});
}

void SceneBuilder::clientGone(ClientId client, Nanos now) {
  state_->clientGone(client, now);
}

std::optional<Nanos> SceneBuilder::nextDeadline() const {
  return state_->nextDeadline();
}

std::optional<Nanos> SceneBuilder::oldestEdit() const {
  return state_->oldestEdit();
}

std::shared_ptr<const SceneSnapshot> SceneBuilder::publish(Nanos now, std::vector<Notice>& notices) {
  return state_->publish(now, notices);
}

SceneDescription SceneBuilder::describe() const {
  return state_->describe();
}

std::vector<ClientCommand> SceneBuilder::editsUnderWay(Nanos now) const {
  return state_->editsUnderWay(now);
}

std::vector<ClientCommand> SceneBuilder::commands(Nanos now) const {
  return state_->commands(now);
}

std::uint64_t SceneBuilder::revision() const noexcept {
  return state_->revision();
}

std::optional<std::uint64_t> SceneBuilder::revisionWith(Nanos edits) const {
  return state_->revisionWith(edits);
}

const std::shared_ptr<ForceOwners>& SceneBuilder::owners() const noexcept {
  return state_->owners();
}

std::uint64_t SceneBuilder::resets() const noexcept {
  return state_->resets();
}

}  // namespace hapticd::scene
