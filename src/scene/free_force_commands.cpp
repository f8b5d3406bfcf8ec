// The commands on forces that belong to no object.
#include <algorithm>
#include <array>

#include "base/time.h"
#include "scene/free_forces.h"
#include "scene/matrices.h"
#include "scene/surface_settings.h"

namespace hapticd::scene {
namespace {

constexpr double kTau = 2 * EIGEN_PI;
constexpr double kLongest_ms = 1e9;

double atLeastZero(double value, std::string_view what, const DefineEffect& c, const Call& call) {
  if (value >= 0) return value;
  call.warn("setEffect", "negative, 0 is used", " ", c.index, ", ", what, " ", value);
  return 0;
}

double lowered(double value, double max, std::string_view what, const DefineEffect& c, const Call& call) {
  if (value <= max) return value;
  call.warn("setEffect", "would be unstable on this device and is lowered", " ", c.index, ", ", what, " ",
            value / 1000, " to ", max / 1000);
  return max;
}

// From half of the servo's rate on, the samples of a vibration are those of a slower one, at the rate itself
// of a constant force.
template <class... Which>
double renderable(double frequency, double unit_Hz, const SceneConfig& config, const Call& call,
                  std::string_view command, const Which&... which) {
  const double highest = 0.45 / config.servoPeriod_s / unit_Hz;
  if (frequency <= highest) return frequency;
  call.warn(command, "a vibration above what the servo renders is lowered", which..., "frequency ", frequency,
            " to ", highest);
  return highest;
}

std::optional<std::string_view> firstUnusable(const EffectKind& kind, const DefineEffect& c) {
  if (!isUsable(c.magnitude_N)) return "magnitude";
  if (kind.gain && !isUsable(c.gain)) return "gain";
  if (kind.duration && !isUsable(c.duration_ms)) return "duration";
  if (kind.frequency && !isUsable(c.frequency)) return "frequency";
  if (kind.position && !isUsable(c.position)) return "position";
  if (kind.direction && !isUsable(c.direction)) return "direction";
  return std::nullopt;
}

Effect effectFrom(const EffectKind& kind, const DefineEffect& c, const SceneConfig& config,
                  const PassivityBound& bound, const Call& call) {
  Effect e;
  e.index = c.index;
  e.type = kind.type;
  e.magnitude_N = atLeastZero(c.magnitude_N, "magnitude", c, call);
  if (kind.gain) {
    const double max =
        kind.type == EffectType::viscous ? bound.maxDamping_Ns_per_m(0) : bound.maxStiffness_N_per_m();
    e.gain = lowered(1000 * atLeastZero(c.gain, "gain", c, call), max, "gain", c, call);
  }
  if (kind.duration && atLeastZero(c.duration_ms, "duration", c, call) > 0)
    e.duration = std::max<Nanos>(1, base::toNanos(std::min(c.duration_ms, kLongest_ms) / 1000));
  if (kind.frequency) {
    const bool inRadians = kind.type == EffectType::contactVibration &&
                           config.contactVibrationUnit == VibrationUnit::radPerSecond;
    const double asked = atLeastZero(c.frequency, "frequency", c, call);
    e.angularFrequency_rad_per_s =
        (inRadians ? 1 : kTau) *
        renderable(asked, inRadians ? 1 / kTau : 1, config, call, "setEffect", " ", c.index, ", ");
  }
  if (kind.position) e.position = c.position;
  if (kind.direction) {
    e.direction = c.direction;
    if (c.direction.isZero(0)) {
      call.warn("setEffect", "the direction is zero, there will be no force", " ", c.index, ", constant");
    }
  }
  e.inDeviceFrame = config.motorVibrationFrame == VibrationFrame::device;
  return e;
}

// The oldest goes first: the servo follows 16 fields that ramp out.
void addLeaving(OwnedForce<ForceField>&& field, std::vector<OwnedForce<ForceField>>& leaving) {
  if (leaving.size() == kMostReplacedFields) leaving.erase(leaving.begin());
  leaving.push_back(std::move(field));
}

}  // namespace

std::string_view nameOf(EffectType type) {
  const auto* kind = std::find_if(std::begin(kEffectKinds), std::end(kEffectKinds),
                                  [&](const EffectKind& k) { return k.type == type; });
  return kind != std::end(kEffectKinds) ? kind->name : "";
}

// The types by the first of their names.
std::string kindNames() {
  std::string names;
  for (const EffectKind& kind : kEffectKinds) {
    if (kind.name != nameOf(kind.type)) continue;
    names += names.empty() ? "" : ", ";
    names += kind.name;
  }
  return names;
}

template <>
void FreeForces::handle(DefineEffect& c, const Call& call) {
  const auto* kind = std::find_if(std::begin(kEffectKinds), std::end(kEffectKinds),
                                  [&](const EffectKind& k) { return k.name == c.type; });
  if (kind == std::end(kEffectKinds)) {
    call.refuse("setEffect", "refused: unknown type; use " + kindNames(), " ", c.index, ", '", c.type, "'");
    return;
  }
  if (const auto what = firstUnusable(*kind, c)) {
    call.refuse("setEffect", "refused: not finite or too large", " ", c.index, ", ", *what);
    return;
  }
  const auto known = effects_.find(c.index);
  const bool isNew = known == effects_.end() || known->second.value.effect.releasing;
  if (c.index < 0 || (isNew && countEffects(false) >= config_.limits.effects)) {
    call.refuse("setEffect", "refused: not an index this server takes; use fewer indices, from 0 on", " ",
                c.index, ", at most ", config_.limits.effects, " effects");
    return;
  }
  const Effect effect = effectFrom(*kind, c, config_, bound_, call);
  if (known != effects_.end() && known->second.value.effect.releasing) {
    const Owned<RunningEffect>& leaving = known->second;
    leavingEffects_.push_back(
        {leaving.owner, leaving.value.effect, leaving.goneAt, leaving.outOfWorld, leaving.untoldSince});
    effects_.erase(known);
  }
  Owned<RunningEffect>& entry = effects_[c.index];
  // One that has ended waits for the clock of the servo to end it, too: another duration would go on with it.
  const Nanos lasted = entry.value.effect.duration;
  const bool isTold = entry.untoldSince == kNever;
  if (isTold && lasted > 0 && call.now - entry.value.startedAt >= lasted) entry.value.running = false;
  const std::uint32_t started = entry.value.effect.start;
  entry.value.effect = effect;
  entry.value.asked = c;
  entry.value.effect.owner = ownerOf(call.client);
  entry.value.effect.start = started;
  entry.owner = call.client;
  entry.goneAt = kNever;
  changed_ = true;
  if (entry.value.running && effect.duration > 0)
    entry.goneAt = entry.value.startedAt + effect.duration + kAfterEnd;
  if (const auto waiting = waitingStarts_.find(c.index); waiting != waitingStarts_.end()) {
    start(entry, waiting->second.owner, call.now, call.now);
    waitingStarts_.erase(waiting);
  }
  if (entry.value.running) tellOfSum_.insert(call.client);
}

// The definition may travel by UDP and arrive after the start.
void FreeForces::start(std::int32_t index, Nanos at, Nanos untoldSince, const Call& call) {
  const auto known = effects_.find(index);
  if (known != effects_.end() && !known->second.value.effect.releasing) {
    start(known->second, call.client, at, untoldSince);
    tellOfSum_.insert(call.client);
    return;
  }
  if (waitingStarts_.size() < config_.limits.effects || waitingStarts_.count(index) != 0) {
    waitingStarts_[index] = {call.client, {}, at + kRemember};
    return;
  }
  call.refuse("startEffect", "refused: no such effect was defined; call setEffect first", " ", index);
}

template <>
void FreeForces::handle(StartEffect& c, const Call& call) {
  start(c.index, call.now, call.now, call);
}

// It runs in the servo already.
template <>
void FreeForces::handle(ContinueEffect& c, const Call& call) {
  constexpr Nanos kLongestAgo = Nanos{1} << 60U;
  start(c.index, call.now - std::clamp<Nanos>(c.ran_ns, 0, kLongestAgo), kNever, call);
}

template <>
void FreeForces::handle(StopEffect& c, const Call& call) {
  if (waitingStarts_.erase(c.index) != 0) return;
  const auto known = effects_.find(c.index);
  if (known == effects_.end()) {
    call.warn("stopEffect", "no such effect was defined", " ", c.index);
    return;
  }
  changed_ |= known->second.value.running;
  known->second.value.running = false;
  known->second.goneAt = kNever;
  if (known->second.value.effect.releasing) effects_.erase(known);
}

template <>
void FreeForces::handle(SetPlane& c, const Call& call) {
  constexpr std::string_view kName = "sendSurface";
  if (c.index < 0 || c.index >= kMaxPlanes) {
    call.refuse(kName, "refused: no such plane", " plane ", c.index, ", use 0 to ", kMaxPlanes - 1);
    return;
  }
  const Vec3 normal(c.plane[0], c.plane[1], c.plane[2]);
  const double length = lengthOf(normal);
  if (length == 0) {
    changed_ |= planes_.erase(c.index) != 0;
    return;
  }
  if (!isUsable(length) || !isUsable(c.plane[3])) {
    call.refuse(kName, "refused: not finite or too large", " plane ", c.index, ", ", normal.transpose(), " ",
                c.plane[3]);
    return;
  }
  Plane plane;
  plane.index = c.index;
  plane.normal = normal / length;
  plane.offset = kWorldUnitsPerStockMetre * c.plane[3] / length;
  plane.recovery = std::clamp(c.recoveryCycles, 1, 10'000) * Nanos{1'000'000};
  const auto surface = surfaceFromStock(c.stiffness, c.damping, c.staticFriction, c.dynamicFriction, config_,
                                        call, "sendSurface plane", c.index);
  if (!surface) return;
  plane.surface = *surface;
  plane.surface.dynamicFriction = std::min(plane.surface.dynamicFriction, plane.surface.staticFriction);
  std::string remark;
  keepPassive(plane.surface, bound_, remark);
  if (!remark.empty()) {
    call.post(Notice::Severity::warning, "plane",
              "sendSurface plane " + std::to_string(c.index) + ": " + remark);
  }
  const auto known = planes_.find(c.index);
  const bool stays = known != planes_.end() && !known->second.value.releasing &&
                     known->second.value.normal == plane.normal && known->second.value.offset == plane.offset;
  plane.placement = stays ? known->second.value.placement : ++placements_;
  // It goes on rising as it began: with another time it would fall, or jump.
  if (stays) {
    plane.recovery = known->second.value.recovery;
    c.recoveryCycles = static_cast<std::int32_t>(plane.recovery / Nanos{1'000'000});
  }
  plane.owner = ownerOf(call.client);
  planes_[c.index] = {call.client, plane, kNever};
  asked_.keep(c, call.client, c.index);
  changed_ = true;
}

template <>
void FreeForces::handle(SetPlaneDetail& c, const Call& call) {
  constexpr std::string_view kName = "sendSurface";
  constexpr double kShortestWave_m = 0.00006;
  const double values[] = {c.adhesionNormal_N,    c.adhesionLateral_N, c.textureAmplitude_m,
                           c.textureWavelength_m, c.buzzAmplitude_m,   c.buzzFrequency_Hz};
  for (const double value : values) {
    if (isUsable(value) && value >= 0) continue;
    call.refuse(kName, "refused: adhesion, texture or buzz is negative, not finite or too large",
                " plane 0, ", value);
    return;
  }
  asked_.keep(c, call.client);
  Plane detail;
  detail.adhesionNormal_N = c.adhesionNormal_N;
  detail.adhesionLateral_N = c.adhesionLateral_N;
  detail.textureAmplitude = kWorldUnitsPerStockMetre * c.textureAmplitude_m;
  detail.textureWavelength =
      c.textureWavelength_m == 0
          ? 0
          : kWorldUnitsPerStockMetre * std::max(kShortestWave_m, c.textureWavelength_m);
  detail.buzzAmplitude = kWorldUnitsPerStockMetre * c.buzzAmplitude_m;
  detail.buzzAngularFrequency_rad_per_s =
      kTau * renderable(c.buzzFrequency_Hz, 1, config_, call, kName, " plane 0, buzz ");
  planeDetail_ = {call.client, detail, kNever};
  tellOfDetail_ = true;
  changed_ = true;
}

template <>
void FreeForces::handle(SetForceField& c, const Call& call) {
  constexpr std::string_view kName = "sendForceField";
  ForceField field;
  field.origin = kWorldUnitsPerStockMetre * c.origin_m;
  field.force_N = c.force_N;
  field.jacobian_N_per_unit =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(c.jacobian_N_per_m.data()) /
      kWorldUnitsPerStockMetre;
  field.radius = kWorldUnitsPerStockMetre * c.radius_m;
  if (!isUsable(field.origin) || !isUsable(field.force_N) || !isUsable(field.radius) ||
      !(field.jacobian_N_per_unit.array().abs() <= kLargest).all()) {
    call.refuse(kName, "refused: not finite or too large", " origin ", c.origin_m.transpose(), ", force ",
                c.force_N.transpose(), ", radius ", c.radius_m);
    return;
  }
  changed_ = true;
  letFieldLeave();
  if (field.force_N.isZero(0) && field.jacobian_N_per_unit.isZero(0)) {
    field_.reset();
  } else {
    if (!(field.radius > 0))
      call.warn(kName, "the radius is not above zero, there will be no force", " ", c.radius_m);
    field.number = ++fieldNumbers_;
    field.owner = ownerOf(call.client);
    field_ = {call.client, field, kNever};
    asked_.keep(c, call.client);
  }
}

void FreeForces::letFieldLeave() {
  if (!field_ || !field_->value.releasing) return;
  addLeaving(std::move(*field_), leavingFields_);
  field_.reset();
}

// What a client that left asked for is nothing that the next one asks for.
FreeForces::Constraint& FreeForces::constraintFor(const Call& call) {
  if (constraint_ && constraint_->value.releasing) {
    if (const auto field = fieldOf(constraint_->value))
      addLeaving({constraint_->owner, *field, constraint_->goneAt, constraint_->outOfWorld,
                  constraint_->untoldSince},
                 leavingFields_);
    constraint_.reset();
  }
  if (!constraint_) {
    constraint_ = Owned<Constraint>{};
    constraint_->value.number = ++fieldNumbers_;
    askedOfConstraint_.clear();
  }
  constraint_->owner = call.client;
  constraint_->value.owner = ownerOf(call.client);
  changed_ = true;
  return constraint_->value;
}

template <>
void FreeForces::handle(SetConstraintEnabled& c, const Call& call) {
  constraintFor(call).enabled = c.enabled;
  askedOfConstraint_.keep(c);
}

template <>
void FreeForces::handle(SetConstraintMode& c, const Call& call) {
  if (c.mode < 0 || c.mode > 3) {
    call.refuse("constraint_mode", "refused: use 0 none, 1 point, 2 line or 3 plane", " ", c.mode);
    return;
  }
  constraintFor(call).mode = c.mode;
  askedOfConstraint_.keep(c);
}

template <>
void FreeForces::handle(SetConstraintVector& c, const Call& call) {
  const bool direction =
      c.which == ConstraintVector::lineDirection || c.which == ConstraintVector::planeNormal;
  if (!isUsable(c.value) || (direction && !(lengthOf(c.value) > 0))) {
    call.refuse("constraint", "refused: not finite or too large, or a direction without length", " ",
                c.value.transpose());
    return;
  }
  Constraint& constraint = constraintFor(call);
  askedOfConstraint_.keep(c, 0, static_cast<int>(c.which));
  switch (c.which) {
    case ConstraintVector::point:
      constraint.point_m = c.value;
      break;
    case ConstraintVector::linePoint:
      constraint.linePoint_m = c.value;
      break;
    case ConstraintVector::lineDirection:
      constraint.lineDirection = c.value.stableNormalized();
      break;
    case ConstraintVector::planePoint:
      constraint.planePoint_m = c.value;
      break;
    case ConstraintVector::planeNormal:
      constraint.planeNormal = c.value.stableNormalized();
      break;
  }
}

template <>
void FreeForces::handle(SetConstraintStiffness& c, const Call& call) {
  if (!isUsable(c.stiffness_N_per_m) || c.stiffness_N_per_m < 0) {
    call.refuse("constraint_KSpring", "refused: negative, not finite or too large", " ", c.stiffness_N_per_m);
    return;
  }
  constraintFor(call).stiffness_N_per_m = c.stiffness_N_per_m;
  askedOfConstraint_.keep(c);
}

template <>
void FreeForces::handle(StopCustomEffect&, const Call&) {
  changed_ |= buzz_.has_value();
  buzz_.reset();
}

template <>
void FreeForces::handle(StartCustomEffect& c, const Call& call) {
  constexpr std::string_view kName = "startEffect (custom)";
  if (c.effect != 0) {
    call.warn(kName, "there is no such custom effect, none runs now; 0 is a buzz", " ", c.effect);
    StopCustomEffect stop;
    handle(stop, call);
    return;
  }
  std::array<double, 6> p{1, 40, 2, 0, 0, 1};  // N, Hz, s, direction
  std::copy_n(c.parameters.begin(), std::min(p.size(), c.parameters.size()), p.begin());
  if (!std::all_of(p.begin(), p.end(), [](double v) { return isUsable(v); }) || p[1] < 0 || p[2] < 0) {
    call.refuse(
        kName, "refused: a parameter is not finite or too large, or frequency or duration is negative", " 0");
    return;
  }
  Buzz buzz;
  buzz.force_N = p[0] * Vec3(p[3], p[4], p[5]);
  buzz.angularFrequency_rad_per_s = kTau * renderable(p[1], 1, config_, call, kName, " 0, ");
  buzz.duration = base::toNanos(std::min(p[2], kLongest_ms / 1000));
  buzz.start = ++starts_;
  buzz.owner = ownerOf(call.client);
  buzz_ = Owned<Buzz>{call.client, buzz};
  buzz_->endAt(call.now + buzz.duration + kAfterEnd, call.now);
  asked_.keep(c, call.client);
  changed_ = true;
}

template <>
void FreeForces::handle(ReleaseForces&, const Call& call) {
  clientGone(call.client, call.now);
}

void FreeForces::apply(SceneCommand& command, const Call& call) {
  std::visit(
      [&]<class C>(C& c) {
        if constexpr (C::kInfo.target == Target::forces) handle(c, call);
      },
      command);
}

}  // namespace hapticd::scene
