#include "scene/free_forces.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

#include "scene/surface_settings.h"

namespace hapticd::scene {

using geometry::Mat3;

namespace {

double stiffnessOf(const ForceField& field, double worldUnitsPerMetre) {
  return Eigen::JacobiSVD<Mat3>(field.jacobian_N_per_unit).singularValues()[0] * worldUnitsPerMetre;
}

// Takes forces from one world to another that is a similarity of it. Newtons stay newtons.
class Similarity {
 public:
  explicit Similarity(const Affine& motion)
      : motion_(motion), scale_(geometry::scaleOf(motion.linear())), rotation_(motion.linear() / scale_) {}

  void operator()(Effect& effect) const {
    effect.position = motion_ * effect.position;
    effect.direction = rotation_ * effect.direction;
    effect.onDevice = true;
  }
  void operator()(RunningEffect& running) const { (*this)(running.effect); }
  void operator()(Plane& plane) const {
    const Vec3 point = motion_ * Vec3(-plane.offset * plane.normal);
    plane.normal = (rotation_ * plane.normal).normalized();
    plane.offset = -plane.normal.dot(point);
    plane.textureAmplitude *= scale_;
    plane.textureWavelength *= scale_;
    plane.buzzAmplitude *= scale_;
  }
  void operator()(ForceField& field) const {
    field.origin = motion_ * field.origin;
    field.force_N = rotation_ * field.force_N;
    field.jacobian_N_per_unit = rotation_ * field.jacobian_N_per_unit * rotation_.transpose() / scale_;
    field.radius *= scale_;
  }
  void operator()(ForceConstraint& constraint) const {
    const auto place = [this](Vec3& point_m) { point_m = motion_ * Vec3(1000 * point_m) / 1000; };
    place(constraint.point_m);
    place(constraint.linePoint_m);
    place(constraint.planePoint_m);
    constraint.lineDirection = (rotation_ * constraint.lineDirection).normalized();
    constraint.planeNormal = (rotation_ * constraint.planeNormal).normalized();
    constraint.stiffness_N_per_m /= scale_;
  }
  void operator()(Buzz& buzz) const { buzz.force_N = rotation_ * buzz.force_N; }

 private:
  Affine motion_;
  double scale_;
  Mat3 rotation_;
};

}  // namespace

FreeForces::FreeForces(const SceneConfig& config)
    : config_(config), bound_(config), stopwatch_(config.stopwatch) {}

void FreeForces::start(Owned<RunningEffect>& entry, ClientId client, Nanos at, Nanos untoldSince) {
  entry.owner = client;
  entry.value.running = true;
  entry.value.startedAt = at;
  entry.value.effect.start = ++starts_;
  entry.value.effect.releasing = false;
  entry.value.effect.owner = ownerOf(client);
  const Nanos duration = entry.value.effect.duration;
  entry.goneAt = duration > 0 ? at + duration + kAfterEnd : kNever;
  entry.untoldSince = untoldSince;
  changed_ = true;
}

// The spring that pulls to the point, line or plane, as stock clients themselves compute it.
std::optional<ForceField> FreeForces::fieldOf(const Constraint& c) const {
  if (!c.enabled || c.mode == 0) return std::nullopt;
  const Mat3 outer = c.mode == 2   ? Mat3(Mat3::Identity() - c.lineDirection * c.lineDirection.transpose())
                     : c.mode == 3 ? Mat3(c.planeNormal * c.planeNormal.transpose())
                                   : Mat3(Mat3::Identity());
  ForceField field;
  field.origin = kWorldUnitsPerStockMetre * (c.mode == 1   ? c.point_m
                                             : c.mode == 2 ? c.linePoint_m
                                                           : c.planePoint_m);
  field.jacobian_N_per_unit = -c.stiffness_N_per_m / kWorldUnitsPerStockMetre * outer;
  field.radius = std::numeric_limits<double>::infinity();
  field.number = c.number;
  field.releasing = c.releasing;
  field.owner = c.owner;
  return field;
}

ForceField FreeForces::passive(ForceField field, double worldUnitsPerMetre) const {
  const double stiffest = stiffnessOf(field, worldUnitsPerMetre);
  const double max = bound_.maxStiffness_N_per_m();
  if (stiffest > max) field.jacobian_N_per_unit *= max / stiffest;
  // The rim is a spring, too: it becomes wider, and where the radius leaves no room for that, the field
  // weaker.
  const double radius_m = field.radius / worldUnitsPerMetre;
  if (!std::isfinite(radius_m) || !(radius_m > 0)) return field;
  const double most_N = field.force_N.norm() + std::min(stiffest, max) * radius_m;
  const double wanted = std::min(most_N, ForceField::kLargest_N) / (max * radius_m);
  field.rim = std::clamp(wanted, field.rim, 1.0);
  if (wanted > 1) {
    const double share = max * radius_m / most_N;
    field.force_N *= share;
    field.jacobian_N_per_unit *= share;
  }
  return field;
}

// What ramps out is gone too soon to shake a hand.
SpringSum FreeForces::sumOfEffects() const {
  SpringSum sum;
  for (const auto& [index, entry] : effects_) {
    const Effect& effect = entry.value.effect;
    if (!entry.value.running || effect.releasing) continue;
    (effect.type == EffectType::viscous ? sum.damping_Ns_per_m : sum.stiffness_N_per_m) += effect.gain;
  }
  return sum;
}

std::vector<ForceField> FreeForces::passiveFields(double worldUnitsPerMetre) const {
  std::vector<ForceField> fields;
  if (field_) fields.push_back(passive(field_->value, worldUnitsPerMetre));
  if (constraint_) {
    if (const auto field = fieldOf(constraint_->value)) fields.push_back(passive(*field, worldUnitsPerMetre));
  }
  for (const auto& entry : leavingFields_) fields.push_back(passive(entry.value, worldUnitsPerMetre));
  return fields;
}

double FreeForces::load_Ns_per_m(double worldUnitsPerMetre) const {
  return loadWith(passiveFields(worldUnitsPerMetre), worldUnitsPerMetre);
}

double FreeForces::loadWith(const std::vector<ForceField>& fields, double worldUnitsPerMetre) const {
  SpringSum sum = sumOfEffects();
  for (const ForceField& field : fields) {
    if (!field.releasing) sum.stiffness_N_per_m += stiffnessOf(field, worldUnitsPerMetre);
  }
  return bound_.loadOf(sum);
}

// Each alone is within the bound, together they may not be. A contact is one surface: between two it is no
// stiffer than the stiffer one.
double FreeForces::shareTogether(double load_Ns_per_m) const {
  if (load_Ns_per_m == 0) return 1;
  double heaviest = heaviestSurface_Ns_per_m_;
  for (const auto& [index, entry] : planes_) {
    if (!entry.value.releasing) heaviest = std::max(heaviest, loadOf(entry.value.surface, bound_));
  }
  return bound_.shareOf(load_Ns_per_m + heaviest);
}

void FreeForces::keepPassiveTogether(PublishedForces& forces, double worldUnitsPerMetre) {
  const double load = loadWith(forces.fields, worldUnitsPerMetre);
  worldUnitsPerMetre_ = worldUnitsPerMetre;
  share_ = shareTogether(load);
  if (load == 0) return;
  for (Plane& plane : forces.planes) keepPassiveBeside(plane.surface, load, bound_);
  if (share_ == 1) return;
  for (Effect& effect : forces.effects) {
    if (!effect.releasing) effect.gain *= share_;
  }
  for (ForceField& field : forces.fields) {
    if (!field.releasing) field.jacobian_N_per_unit *= share_;
  }
}

// Warns the clients whose effects started or changed and are lowered beside what else acts.
void FreeForces::tellOfEffects(Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  const long percent = std::lround(100 * share_);
  for (const ClientId client : std::exchange(tellOfSum_, {})) {
    const bool isLowered =
        percent < 100 && std::any_of(effects_.begin(), effects_.end(), [client](const auto& e) {
          const RunningEffect& effect = e.second.value;
          return e.second.owner == client && effect.running && !effect.effect.releasing &&
                 effect.effect.gain > 0;
        });
    if (!isLowered) continue;
    const Call call{client, now, false, board, out};
    call.warn(
        "startEffect",
        "all effects together, with the fields and surfaces, would be unstable on this device: their gains "
        "are lowered",
        " to ", percent, " %");
  }
}

void FreeForces::tellOfDetail(double worldUnitsPerMetre, Nanos now, NoticeBoard& board,
                              std::vector<Notice>& out) {
  if (!std::exchange(tellOfDetail_, false) || !planeDetail_ || planeDetail_->value.releasing) return;
  const Plane& detail = planeDetail_->value;
  const double highest = std::max(detail.textureAmplitude, detail.buzzAmplitude);
  const double most = kHighestDetail_m * worldUnitsPerMetre;
  if (highest <= most) return;
  const Call call{planeDetail_->owner, now, false, board, out};
  call.warn("sendSurface", "a texture or buzz is higher than 10 mm of the device and is lowered to that",
            " plane 0, ", highest / kWorldUnitsPerStockMetre, " m to ", most / kWorldUnitsPerStockMetre);
}

// Once for each field and share: its owner learns why it feels less than it asked for.
void FreeForces::tellOfFields(const PublishedForces& forces, double worldUnitsPerMetre, Nanos now,
                              NoticeBoard& board, std::vector<Notice>& out) {
  const auto tell = [&](std::string_view name, const ForceField& asked, ClientId owner, FieldShare& told) {
    const auto given = std::find_if(forces.fields.begin(), forces.fields.end(),
                                    [&](const ForceField& f) { return f.number == asked.number; });
    if (asked.releasing || given == forces.fields.end()) return;
    const double stiffness = stiffnessOf(asked, worldUnitsPerMetre);
    const double left = stiffnessOf(*given, worldUnitsPerMetre);
    const double force_N = asked.force_N.norm();
    const FieldShare share{asked.number, stiffness > 0 ? std::lround(100 * left / stiffness) : 100,
                           force_N > 0 ? std::lround(100 * given->force_N.norm() / force_N) : 100};
    if (std::exchange(told, share) == share) return;
    const Call call{owner, now, false, board, out};
    constexpr std::string_view kReason =
        "would be unstable on this device, alone or with the effects and surfaces, and is lowered";
    if (share.stiffness_percent < 100)
      call.warn(name, kReason, ", stiffness ", stiffness, " to ", left, " N/m");
    if (share.force_percent < 100)
      call.warn(name, kReason, ", force ", force_N, " to ", given->force_N.norm(), " N");
  };
  if (field_) tell("sendForceField", field_->value, field_->owner, fieldTold_);
  if (!constraint_) return;
  if (const auto asked = fieldOf(constraint_->value))
    tell("constraint_KSpring", *asked, constraint_->owner, constraintTold_);
}

// Once for each owner and share: stock clients send their planes all the time.
void FreeForces::tellOfPlanes(const PublishedForces& forces, Nanos now, NoticeBoard& board,
                              std::vector<Notice>& out) {
  for (const Plane& given : forces.planes) {
    const Owned<Plane>& asked = planes_.at(given.index);
    const double load = loadOf(asked.value.surface, bound_);
    if (given.releasing || load == 0) continue;
    const PlaneShare share{asked.owner, std::lround(100 * loadOf(given.surface, bound_) / load)};
    if (std::exchange(planesTold_[static_cast<std::size_t>(given.index)], share) == share) continue;
    if (share.percent == 100) continue;
    const Call call{asked.owner, now, false, board, out};
    call.warn("sendSurface",
              "would be unstable on this device beside the effects and fields that run, and is lowered",
              " plane ", given.index, " to ", share.percent, " %");
  }
}

PublishedForces FreeForces::publish(Nanos now, double worldUnitsPerMetre, double heaviestSurface_Ns_per_m,
                                    NoticeBoard& board, std::vector<Notice>& out) {
  heaviestSurface_Ns_per_m_ = heaviestSurface_Ns_per_m;
  PublishedForces forces;
  for (const auto& [index, entry] : effects_) {
    if (entry.value.running) forces.effects.push_back(entry.value.effect);
  }
  for (const auto& entry : leavingEffects_) forces.effects.push_back(entry.value);
  for (const auto& [index, entry] : planes_) {
    Plane plane = entry.value;
    // While it ramps out it belongs to the plane that does, and not to one that another client has set since.
    if (index == 0 && planeDetail_ && (plane.releasing || !planeDetail_->value.releasing)) {
      const Plane& detail = planeDetail_->value;
      plane.adhesionNormal_N = detail.adhesionNormal_N;
      plane.adhesionLateral_N = detail.adhesionLateral_N;
      plane.textureAmplitude = detail.textureAmplitude;
      plane.textureWavelength = detail.textureWavelength;
      plane.buzzAmplitude = detail.buzzAmplitude;
      plane.buzzAngularFrequency_rad_per_s = detail.buzzAngularFrequency_rad_per_s;
    }
    forces.planes.push_back(plane);
  }
  forces.fields = passiveFields(worldUnitsPerMetre);
  keepPassiveTogether(forces, worldUnitsPerMetre);
  tellOfEffects(now, board, out);
  tellOfFields(forces, worldUnitsPerMetre, now, board, out);
  tellOfPlanes(forces, now, board, out);
  tellOfDetail(worldUnitsPerMetre, now, board, out);
  if (buzz_) forces.buzz = buzz_->value;
  beginInServo(now);
  return forces;
}

// The servo starts and ramps by its own clock, from the tick that is given this publication. Large meshes in
// it take longer to build than many a force lasts. All builders of a scene count from one time: a recording
// that begins meanwhile describes the forces by one of them.
void FreeForces::beginInServo(Nanos now) {
  Nanos told = kNever;  // read once, and only for a force that ends: recordings keep each reading
  forEachForce([&](auto& owned) {
    const Nanos since = std::exchange(owned.untoldSince, kNever);
    if (since == kNever || owned.goneAt == kNever) return;
    if (told == kNever) told = std::max(now, stopwatch_ ? stopwatch_() : now);
    // A recording dates the publication of the scene that it begins with before what describes it.
    const Nanos later = std::max<Nanos>(told - since, 0);
    owned.goneAt += later;
    if constexpr (requires { owned.value.startedAt; }) owned.value.startedAt += later;
  });
}

// By their owners, whichever client sent the command.
void FreeForces::appendCommands(Nanos now, std::vector<ClientCommand>& out) const {
  const auto add = [&](ClientId owner, const auto* command) {
    if (command != nullptr) out.push_back({owner, *command});
  };
  for (const auto& [index, entry] : effects_) {
    if (entry.value.effect.releasing) continue;
    add(entry.owner, &entry.value.asked);
    if (entry.value.running) out.push_back({entry.owner, ContinueEffect{index, now - entry.value.startedAt}});
  }
  for (const auto& [index, entry] : waitingStarts_)
    out.push_back({entry.owner, ContinueEffect{index, now - (entry.goneAt - kRemember)}});
  if (planeDetail_ && !planeDetail_->value.releasing) add(planeDetail_->owner, asked_.find<SetPlaneDetail>());
  for (const auto& [index, entry] : planes_) {
    if (!entry.value.releasing) add(entry.owner, asked_.find<SetPlane>(index));
  }
  if (field_ && !field_->value.releasing) add(field_->owner, asked_.find<SetForceField>());
  if (constraint_ && !constraint_->value.releasing) {
    const std::size_t first = out.size();
    askedOfConstraint_.appendTo(out);
    for (std::size_t i = first; i < out.size(); ++i) out[i].client = constraint_->owner;
  }
  if (buzz_ && !buzz_->value.releasing && buzz_->goneAt > now) {
    add(buzz_->owner, asked_.find<StartCustomEffect>());
  }
}

std::size_t FreeForces::countEffects(bool releasing) const {
  return static_cast<std::size_t>(std::count_if(effects_.begin(), effects_.end(), [&](const auto& e) {
    return e.second.value.effect.releasing == releasing;
  }));
}

// Of clients that reset and start all anew, again and again within 300 ms. The oldest go first, and those
// whose index has been taken before those that still have it at the same time.
void FreeForces::boundReleasingEffects() {
  for (std::size_t count = countEffects(true) + leavingEffects_.size(); count > kMostReleasing; --count) {
    const auto older = [](const auto& a, const auto& b) { return a.goneAt < b.goneAt; };
    const auto replaced = std::min_element(leavingEffects_.begin(), leavingEffects_.end(), older);
    auto oldest = effects_.end();
    for (auto it = effects_.begin(); it != effects_.end(); ++it) {
      if (!it->second.value.effect.releasing) continue;
      if (oldest == effects_.end() || older(it->second, oldest->second)) oldest = it;
    }
    const bool isReplaced = replaced != leavingEffects_.end() &&
                            (oldest == effects_.end() || replaced->goneAt <= oldest->second.goneAt);
    if (isReplaced) {
      leavingEffects_.erase(replaced);
    } else {
      effects_.erase(oldest);
    }
  }
}

// What ramps out stays as weak as it was beside the others, although it counts no more.
template <class F>
void FreeForces::release(const F& whose, Nanos now, bool endsWorld) {
  const double load = load_Ns_per_m(worldUnitsPerMetre_);
  const double share = std::min(share_, shareTogether(load));
  // True for one that begins to ramp out.
  const auto letGo = [&](auto& owned, bool& releasing) {
    if (!whose(owned.owner) || releasing) return false;
    releasing = true;
    owned.outOfWorld = endsWorld;
    owned.endAt(std::min(owned.goneAt, now + kRelease), now);
    return changed_ = true;
  };
  std::erase_if(effects_, [&](const auto& e) { return whose(e.second.owner) && !e.second.value.running; });
  std::erase_if(waitingStarts_, [&](const auto& e) { return whose(e.second.owner); });
  for (auto& [index, entry] : effects_) {
    if (letGo(entry, entry.value.effect.releasing)) entry.value.effect.gain *= share;
  }
  boundReleasingEffects();
  for (auto& [index, entry] : planes_) {
    if (letGo(entry, entry.value.releasing)) keepPassiveBeside(entry.value.surface, load, bound_);
  }
  if (planeDetail_) letGo(*planeDetail_, planeDetail_->value.releasing);
  if (field_ && letGo(*field_, field_->value.releasing)) {
    field_->value = passive(field_->value, worldUnitsPerMetre_);
    field_->value.jacobian_N_per_unit *= share;
  }
  if (constraint_ && letGo(*constraint_, constraint_->value.releasing)) {
    double& stiffness = constraint_->value.stiffness_N_per_m;
    const double most = bound_.maxStiffness_N_per_m() * kWorldUnitsPerStockMetre / worldUnitsPerMetre_;
    stiffness = share * std::min(stiffness, most);
  }
  if (buzz_) letGo(*buzz_, buzz_->value.releasing);
}

void FreeForces::clientGone(ClientId client, Nanos now) {
  release([client](ClientId owner) { return owner == client; }, now, false);
}

template <class F>
void FreeForces::forEachForce(const F& f) {
  for (auto& [index, entry] : effects_) f(entry);
  for (auto& entry : leavingEffects_) f(entry);
  for (auto& [index, entry] : planes_) f(entry);
  for (auto& entry : leavingFields_) f(entry);
  if (planeDetail_) f(*planeDetail_);
  if (field_) f(*field_);
  if (constraint_) f(*constraint_);
  if (buzz_) f(*buzz_);
}

// The server clears a scene on behalf of a client that left, whose forces ramp out already.
void FreeForces::reset(ClientId client, Nanos now) {
  release([](ClientId) { return true; }, now, true);
  forEachForce([client](auto& owned) { owned.outOfWorld = owned.outOfWorld || owned.owner == client; });
}

void FreeForces::keepResetInPlace(const Affine& motion) {
  const Similarity move(motion);
  forEachForce([&](auto& owned) {
    if (owned.outOfWorld) move(owned.value);
  });
}

template <class F>
void FreeForces::forEachDeadline(const F& f) const {
  for (const auto& [index, entry] : effects_) f(entry.goneAt);
  for (const auto& [index, entry] : waitingStarts_) f(entry.goneAt);
  for (const auto& [index, entry] : planes_) f(entry.goneAt);
  if (planeDetail_) f(planeDetail_->goneAt);
  if (field_) f(field_->goneAt);
  if (constraint_) f(constraint_->goneAt);
  if (buzz_) f(buzz_->goneAt);
  for (const auto& entry : leavingEffects_) f(entry.goneAt);
  for (const auto& entry : leavingFields_) f(entry.goneAt);
}

std::optional<Nanos> FreeForces::nextDeadline() const {
  Nanos next = kNever;
  forEachDeadline([&](Nanos at) { next = std::min(next, at); });
  return next == kNever ? std::nullopt : std::optional<Nanos>(next);
}

bool FreeForces::update(Nanos now, NoticeBoard& board, std::vector<Notice>& out) {
  for (auto it = waitingStarts_.begin(); it != waitingStarts_.end();) {
    if (now < it->second.goneAt) {
      ++it;
      continue;
    }
    const Call call{it->second.owner, now, false, board, out};
    call.warn("startEffect", "no such effect was defined within a second; call setEffect first", " ",
              it->first);
    it = waitingStarts_.erase(it);
  }
  const auto gone = [now, since = std::exchange(updatedAt_, now)](const auto& owned) {
    return owned.isGone(now, since);
  };
  for (auto it = effects_.begin(); it != effects_.end();) {
    auto& [index, entry] = *it;
    if (!gone(entry)) {
      ++it;
      continue;
    }
    changed_ = true;
    entry.value.running = false;
    entry.goneAt = kNever;
    it = entry.value.effect.releasing ? effects_.erase(it) : std::next(it);
  }
  changed_ |= std::erase_if(planes_, [&](const auto& e) { return gone(e.second); }) != 0;
  changed_ |= std::erase_if(leavingEffects_, gone) != 0;
  changed_ |= std::erase_if(leavingFields_, gone) != 0;
  const auto drop = [&](auto& optional) {
    if (!optional || !gone(*optional)) return;
    optional.reset();
    changed_ = true;
  };
  drop(planeDetail_);
  drop(field_);
  drop(constraint_);
  drop(buzz_);
  return std::exchange(changed_, false);
}

}  // namespace hapticd::scene
