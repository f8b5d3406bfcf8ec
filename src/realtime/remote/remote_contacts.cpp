#include "realtime/remote/remote_contacts.h"

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "realtime/remote/at_most.h"
#include "realtime/remote/normal_shares.h"
#include "realtime/render/release.h"

namespace hapticd::realtime {
namespace {

// Of the 0.3 N/ms. One contact leaves a rest for friction, which follows the normal force. Several share
// less, because in a corner the force changes faster than what each face demands; a fade and corrections
// share it, too.
constexpr double kCorrection_N_per_s = 0.8 * kRemoteRate_N_per_s;
constexpr double kShared_N_per_s = 0.45 * kRemoteRate_N_per_s;
constexpr double kFade_N_per_s = 0.4 * kRemoteRate_N_per_s;
constexpr double kBesideFade_N_per_s = 0.25 * kRemoteRate_N_per_s;
constexpr double kOfAll_N_per_s = 0.75 * kRemoteRate_N_per_s;  // what corrections change in the sum
constexpr int kTries = 4;
constexpr double kFadeOfAll = 0.8;  // part of it that a fade may take
constexpr double kLeast = 0.2;      // part of it for corrections, however much a fade takes
constexpr double kEarly = 1.5;      // several contacts begin to fade earlier: their fade may be held up
constexpr Nanos kFadePart = 3;      // the last third of a life: who repeats must not feel a fade
constexpr double kQuickFade_N_per_s = 1000;  // unless the force would fall faster
constexpr double kLongestAge_s = 0.2;        // a surface moves on no longer than this without an update
constexpr double kLateral = 0.5;             // share of the stiffness that holds a sticking point
constexpr double kStick = 0.9;               // of the dynamic bound: sliding ends below it
constexpr double kLent_J = 2e-4;             // to the springs of friction, at the first touch
constexpr double kSlow_m_per_s = 0.01;       // below it the damping coefficient may change as at this speed
constexpr double kRests_m_per_s = 2e-3;      // a surface that is slower does no work to speak of
constexpr double kSameNormal = 1e-6;         // of a surface that is stated again in single precision

// The shortest rotation between unit vectors; for opposite ones half a turn about any axis across.
Vec3 rotationVector(const Vec3& from, const Vec3& to) noexcept {
  const Vec3 cross = from.cross(to);
  const double sine = cross.norm();
  const double angle = std::atan2(sine, from.dot(to));
  if (sine > 1e-9) return angle / sine * cross;
  return angle < 1 ? Vec3(Vec3::Zero()) : Vec3(angle * from.unitOrthogonal());
}

// Brings `value` nearer to `goal`; a whole unit of change would change the force by `force_N`.
double towards(double value, double goal, double force_N, double& budget_N) noexcept {
  const double want = std::abs(goal - value);
  const double cost = want * force_N;
  if (cost <= budget_N) {
    budget_N -= cost;
    return goal;
  }
  const double share = budget_N / cost;
  budget_N = 0;
  return value + share * (goal - value);
}

}  // namespace

void RemoteContacts::reset() noexcept {
  for (Slot& slot : slots_) slot.used = false;
  top_ = 0;
  lastTick_ = 0;
  pressed_N_ = 0;
  frictionEnergy_J_ = kLent_J;
  force_N_.setZero();
}

void RemoteContacts::restart(std::uint64_t number) noexcept {
  reset();
  taken_ = number;
}

bool RemoteContacts::remember(RemoteMemory& out) const noexcept {
  out.corrections_J = corrections_.balance_J();
  return top_ == 0;
}

void RemoteContacts::resume(const RemoteMemory& memory, const Vec3& hip_m) noexcept {
  restart(memory.contacts);
  resumed_ = false;
  hand_m_ = hip_m;
  corrections_ = EnergyTank(EnergyBudget{}, memory.corrections_J);
}

void RemoteContacts::moveWithView(const geometry::Affine& motion) noexcept {
  const geometry::Mat3 linear = motion.linear();
  const double scale = geometry::scaleOf(linear);
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    moveBy(motion, slot.contact);
    slot.anchor_m = motion * slot.anchor_m;
    slot.shift_m *= scale;
    slot.turn = linear * slot.turn / scale;
    slot.drift_m_per_s = linear * slot.drift_m_per_s;
    slot.friction_N = rotated(motion, slot.friction_N);
  }
  hand_m_ = motion * hand_m_;
  viewMoved_ = true;
}

Vec3 RemoteContacts::step(const RemoteContactSet& newest, const RemoteHand& hand, Nanos now, double step_s,
                          RemoteRendering& out) noexcept {
  out.contactsTime = newest.clientTime;
  corrections_.refill(step_s);
  if (newest.number != taken_) take(newest, hand, now);
  elapsed_s_ = lastTick_ > 0 ? std::clamp(base::toSeconds(now - lastTick_), 0.0, kLongestAge_s) : step_s;
  lastTick_ = now;
  if (top_ == 0) {
    hand_m_ = hand.position_m;
    frictionEnergy_J_ = kLent_J;
    force_N_.setZero();
    rest_ = true;
    viewMoved_ = false;
    return force_N_;
  }
  fadeOut(now, step_s);

  int changing = 0;
  int leaving = 0;
  bool correcting = false;
  bool moving = false;
  const bool resumed = resumed_;
  resumed_ = false;
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    locate(slot, hand, now);
    changing += !slot.fading && (slot.demand_N > 0 || slot.depth_m > slot.shift_m);
    leaving += slot.fading && slot.demand_N > 0;
    correcting = correcting || (!slot.fading && !isCorrected(slot));
    moving = moving || (!slot.fading && slot.depth_m > 0 && !hardlyChanges(slot, step_s));
  }
  const bool fading = resumed || leaving > 0;
  rest_ = !fading && !moving && !viewMoved_ && hand.scene.rest;
  viewMoved_ = false;
  const double budget_N = (fading         ? kBesideFade_N_per_s
                           : changing > 1 ? kShared_N_per_s
                                          : kCorrection_N_per_s) *
                          step_s / std::max(changing, 1);
  const bool mayRetry = (correcting || fading) && changing + leaving + (hand.scene.count > 0 ? 1 : 0) > 1;
  if (mayRetry) {
    std::copy_n(slots_.begin(), top_, before_.rendered.begin());
    before_.corrections = corrections_;
  }
  const Change change{budget_N, 1};
  late_N_.setZero();
  Vec3 force = forceWith(change, hand, step_s);
  // In a corner the sum changes faster than what each face demands.
  const double most_N = std::max(kOfAll_N_per_s * step_s, due_N_ / kFadeOfAll);
  if (mayRetry && (force - force_N_).squaredNorm() > most_N * most_N)
    force = forceWithin(change, most_N, hand, step_s);
  force_N_ = force;
  hand_m_ = hand.position_m;
  scene_ = hand.scene;
  frictionEnergy_J_ = frictionNow_J_;
  const auto moves = [](const Slot& slot) {
    return slot.used && slot.normal_N > 0 && slot.velocity.norm() > kRests_m_per_s;
  };
  rest_ = rest_ && std::ranges::none_of(inUse(), moves);
  report(hand, out);
  return out.contactForce_N;
}

void RemoteContacts::report(const RemoteHand& hand, RemoteRendering& out) noexcept {
  for (const Slot& slot : inUse()) {
    if (!slot.used || slot.normal_N <= 0) continue;
    if (out.count == kMaxRemoteContacts) continue;
    out.contacts[out.count++] = {
        slot.contact.id, (hand.position_m + slot.depth_m * slot.normal).cast<float>(),
        (slot.normal_N * slot.normal + slot.friction_N).cast<float>(), static_cast<float>(slot.depth_m)};
  }
  if (held_) out.status |= kRemoteCorrectionsHeld;
  out.contactForce_N = force_N_ - late_N_;
}

// Shared as the normal force is; what the shares store has that force as its gradient.
RemoteSprings RemoteContacts::springs() const noexcept {
  RemoteSprings out;
  PressingContacts pressing;
  for (const Slot& slot : slots_) {
    if (!slot.used || slot.depth_m <= 0) continue;
    const double stiffness = slot.stiffness_N_per_m;
    pressing.add(slot.normal, stiffness, slot.gain * stiffness * slot.depth_m, slot.normal_N);
    out.stiffest_N_per_m = std::max(out.stiffest_N_per_m, stiffness);
    if (slot.normal_N <= 0) continue;
    out.force_N += slot.friction_N;
    out.stored_J += 0.5 * slot.friction_N.dot(slot.anchor_m - hand_m_);
  }
  out.beside = pressing.count > 0 && scene_.count > 0;
  if (out.beside) {
    pressing.add(scene_, 1);
    const Vec3 way_m = scene_.way_m();
    out.normal_N = -scene_.stiffness_N_per_m * way_m;
    out.stored_J -= 0.5 * scene_.stiffness_N_per_m * way_m.squaredNorm();
  }
  shareNormalForce(pressing);
  for (std::size_t i = 0; i < pressing.count; ++i) {
    out.normal_N += pressing.share_N[i] * pressing.normal(i);
    out.stored_J += 0.5 * pressing.share_N[i] * pressing.depth_m[i];
  }
  out.force_N += out.normal_N;
  return out;
}

// Changes and solves.
Vec3 RemoteContacts::forceWith(const Change& change, const RemoteHand& hand, double step_s) noexcept {
  held_ = false;
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    if (slot.fading) {
      const double falls = change.fade * slot.fadeStep;
      giveBack(slot, 0.5 * falls * slot.stiffness_N_per_m * slot.depth_m * slot.depth_m);
      slot.gain -= falls;
    } else {
      correct(slot, hand, change.correction_N, step_s);
    }
    demand(slot, hand);
  }
  const Vec3 normal_N = share(hand);
  const Vec3 moved_m = hand.position_m - hand_m_;
  double given_J = 0;  // by the hand to friction, since the last tick
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    const Vec3 before_N = slot.friction_N;
    slot.friction_N = friction(slot, hand, pressed_N_, elapsed_s_);
    given_J -= 0.5 * (before_N + slot.friction_N).dot(moved_m - elapsed_s_ * slot.velocity);
  }
  return normal_N + limitFriction(hand, given_J);
}

// The springs of friction hold no more than the hand gave them. Where several contacts share the normal
// force, their springs change with the shares, and on a round surface with the normal: on some closed ways
// that gives energy. What they are lent keeps a tremor in a corner from wearing friction out.
Vec3 RemoteContacts::limitFriction(const RemoteHand& hand, double given_J) noexcept {
  Vec3 friction_N = Vec3::Zero();
  double energy_J = 0;
  for (const Slot& slot : inUse()) {
    if (!slot.used || slot.normal_N <= 0) continue;
    friction_N += slot.friction_N;
    energy_J += 0.5 * slot.friction_N.dot(slot.anchor_m - hand.position_m);
  }
  frictionNow_J_ = std::clamp(frictionEnergy_J_ + given_J, 0.0, energy_J + kLent_J);
  if (energy_J > frictionNow_J_) {
    const double share = std::sqrt(frictionNow_J_ / energy_J);
    for (Slot& slot : inUse()) {
      if (!slot.used || slot.normal_N <= 0) continue;
      slot.friction_N *= share;
      slot.anchor_m = hand.position_m + share * (slot.anchor_m - hand.position_m);
    }
    friction_N *= share;
    energy_J = frictionNow_J_;
  }
  for (Slot& slot : inUse()) {
    if (slot.used && slot.normal_N <= 0) takeHold(slot, hand, friction_N, energy_J);
  }
  return friction_N;
}

Vec3 RemoteContacts::forceAgain(const Change& change, const RemoteHand& hand, double step_s) noexcept {
  for (std::size_t i = 0; i < top_; ++i) static_cast<Rendered&>(slots_[i]) = before_.rendered[i];
  corrections_ = before_.corrections;
  return forceWith(change, hand, step_s);
}

// As large a part of the changes as the rate allows; the fade comes first, because it must end in time.
Vec3 RemoteContacts::forceWithin(const Change& most, double most_N, const RemoteHand& hand,
                                 double step_s) noexcept {
  const Vec3 unchanged = forceAgain({}, hand, step_s);
  Change change{0, most.fade};
  Vec3 force = forceAgain(change, hand, step_s);
  for (int i = 0; i < kTries && (force - unchanged).norm() > kFadeOfAll * most_N; ++i) {
    change.fade *= 0.9 * kFadeOfAll * most_N / (force - unchanged).norm();
    force = forceAgain(change, hand, step_s);
  }
  const Vec3 faded = force;
  const double left_N = std::max(most_N - (faded - unchanged).norm(), kLeast * most_N);
  change.correction_N = most.correction_N;
  force = forceAgain(change, hand, step_s);
  for (int i = 0; i < kTries && (force - faded).norm() > left_N; ++i) {
    change.correction_N *= 0.9 * left_N / (force - faded).norm();
    force = forceAgain(change, hand, step_s);
  }
  // Other contacts may bear after the smallest change: then the rest of the jump comes in the next tick.
  late_N_ = force - unchanged - atMost(force - unchanged, most_N);
  return force;
}

RemoteContacts::Slot* RemoteContacts::slotFor(std::int32_t id) noexcept {
  Slot* unused = nullptr;
  for (Slot& slot : inUse()) {
    if (slot.used && slot.contact.id == id) return &slot;
    if (!slot.used && unused == nullptr) unused = &slot;
  }
  if (unused == nullptr && top_ < kSlots) unused = &slots_[top_++];
  return unused;
}

// A contact without a slot waits for the next update: all slots fade out within the longest life.
void RemoteContacts::take(const RemoteContactSet& set, const RemoteHand& hand, Nanos now) noexcept {
  taken_ = set.number;
  for (Slot& slot : inUse()) slot.stated = false;
  for (std::uint32_t i = 0; i < set.count; ++i) {
    Slot* slot = slotFor(set.contacts[i].id);
    if (slot != nullptr) replace(*slot, set.contacts[i], set, hand, now);
  }
  double leaving_N = 0;
  for (const Slot& slot : inUse()) leaving_N += slot.used && !slot.stated ? slot.demand_N : 0;
  const Nanos length = base::toNanos(leaving_N / kFade_N_per_s);
  for (Slot& slot : inUse()) {
    if (!slot.used || slot.stated || slot.fading) continue;
    slot.fading = true;
    slot.fadeEnd = std::min(slot.end, now + length);
  }
}

// What a fade takes from the spring, the hand gave: it pays for the correction that brings the force back.
void RemoteContacts::giveBack(const Slot& slot, double energy_J) noexcept {
  if (slot.depth_m > 0 && !slot.contact.yields) settle(slot, -energy_J);
}

// The work of a change. Of surfaces on top of each other each pays for its own, but gets back only what it
// bears of it: together they take one spring from the hand.
void RemoteContacts::settle(const Slot& slot, double work_J) noexcept {
  const double borne = slot.demand_N > 0 ? std::min(1.0, slot.normal_N / slot.demand_N) : 0;
  corrections_.give(work_J > 0 ? work_J : borne * work_J);
}

// The surface jumps where the client says, and shift and turn keep spring force and normal of the moment.
void RemoteContacts::replace(Slot& slot, const RemoteContact& contact, const RemoteContactSet& set,
                             const RemoteHand& hand, Nanos now) noexcept {
  const bool known = slot.used;
  double spring_N = 0;
  Vec3 normal = contact.normal;
  Vec3 velocity = Vec3::Zero();
  if (known) {
    locate(slot, hand, now);
    velocity = slot.velocity;
    resumed_ = resumed_ || slot.fading;
    spring_N = slot.gain * slot.stiffness_N_per_m * std::max(0.0, slot.depth_m);
    giveBack(slot, 0.5 * (1 - slot.gain) * spring_N * slot.depth_m);  // by the shift, which weakens it
    normal = slot.normal;
  } else {
    slot = Slot{};
    slot.used = true;
    follow(slot, contact);
    slot.anchor_m = hand.position_m;
  }
  slot.stated = true;
  slot.contact = contact;
  slot.statedAt = set.stated;
  slot.end = set.received + contact.lifetime;
  slot.fading = false;
  slot.gain = 1;
  slot.shift_m = 0;
  slot.turn.setZero();
  slot.drift_m_per_s.setZero();
  locate(slot, hand, now);
  if (known) slot.drift_m_per_s = velocity - slot.velocity;
  if (spring_N <= 0) {
    slot.shift_m = std::min(0.0, -slot.depth_m);
  } else {
    slot.shift_m = spring_N / slot.stiffness_N_per_m - slot.depth_m;
    slot.turn = rotationVector(slot.normal, normal);
  }
}

// The fade of all contacts that end together takes the time in which their force may fall, but no more than a
// part of their life.
void RemoteContacts::fadeOut(Nanos now, double step_s) noexcept {
  const auto pressing =
      std::ranges::count_if(inUse(), [](const Slot& s) { return s.used && s.normal_N > 0; });
  const Nanos needed = base::toNanos((pressing > 1 ? kEarly : 1) * pressed_N_ / kFade_N_per_s + step_s);
  const Nanos least = base::toNanos(force_N_.norm() / kQuickFade_N_per_s + step_s);
  std::size_t top = 0;
  due_N_ = 0;
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    const Nanos length = std::min(needed, std::max(least, slot.contact.lifetime / kFadePart));
    if (!slot.fading && slot.end - now <= length) {
      slot.fading = true;
      slot.fadeEnd = slot.end;
    }
    if (slot.end <= now || (slot.fading && slot.gain <= 0)) {
      slot.used = false;
      continue;
    }
    const double left_s = std::max(0.0, base::toSeconds(slot.fadeEnd - now));
    slot.fadeStep = slot.gain * step_s / (left_s + step_s);
    if (slot.fading) due_N_ += slot.demand_N * step_s / (base::toSeconds(slot.end - now) + step_s);
    top = static_cast<std::size_t>(&slot - slots_.data()) + 1;
  }
  top_ = top;
}

void RemoteContacts::locate(Slot& slot, const RemoteHand& hand, Nanos now) noexcept {
  const double age_s = std::clamp(base::toSeconds(now - slot.statedAt), 0.0, kLongestAge_s);
  const SurfaceAt at = surfaceAt(slot.contact, age_s, hand.position_m);
  slot.depth_m = at.depth_m + slot.shift_m;
  slot.velocity = at.velocity_m_per_s;
  if (!slot.contact.angularVelocity_rad_per_s.isZero(0)) {
    const double square = slot.velocity.squaredNorm();
    if (square > kRemoteSpeed_m_per_s * kRemoteSpeed_m_per_s)
      slot.velocity *= kRemoteSpeed_m_per_s / std::sqrt(square);
  }
  slot.velocity += slot.drift_m_per_s;
  slot.normal = slot.turn.isZero(0) ? at.normal : turnedBy(slot.turn, at.normal);
}

bool RemoteContacts::isCorrected(const Slot& slot) noexcept {
  const RemoteContact& c = slot.contact;
  return slot.shift_m == 0 && slot.turn.isZero(0) && slot.drift_m_per_s.isZero(0) &&
         slot.stiffness_N_per_m == c.stiffness_N_per_m && slot.damping == c.damping_Ns_per_m &&
         slot.staticFriction == c.staticFriction && slot.dynamicFriction == c.dynamicFriction;
}

// What is left to take back is no more than a surface that rests may move in a tick.
bool RemoteContacts::hardlyChanges(const Slot& slot, double step_s) noexcept {
  return std::abs(slot.shift_m) <= kRests_m_per_s * step_s && slot.turn.norm() <= kSameNormal &&
         slot.drift_m_per_s.norm() <= kRests_m_per_s &&
         slot.stiffness_N_per_m == slot.contact.stiffness_N_per_m;
}

// Takes back shift and turn and lets velocity, stiffness, damping and friction follow, together within the
// budget.
void RemoteContacts::correct(Slot& slot, const RemoteHand& hand, double budget_N, double step_s) noexcept {
  const RemoteContact& c = slot.contact;
  if (slot.depth_m - slot.shift_m <= 0 && slot.depth_m <= 0) {  // untouched: nothing can be felt
    slot.depth_m -= slot.shift_m;
    slot.shift_m = 0;
    slot.turn.setZero();
    slot.velocity -= slot.drift_m_per_s;
    slot.drift_m_per_s.setZero();
    follow(slot, c);
    return;
  }
  if (isCorrected(slot)) return;
  budget_N /= 1 + slot.staticFriction;
  if (slot.shift_m != 0 && slot.depth_m <= 0) {  // free: up to the HIP at once
    const double stated_m = slot.depth_m - slot.shift_m;
    slot.shift_m = std::min(0.0, -stated_m);
    slot.depth_m = stated_m + slot.shift_m;
  }
  if (slot.shift_m != 0) budget_N = takeBackShift(slot, budget_N, step_s);
  const double force_N = slot.demand_N;
  if (const double angle = slot.turn.norm(); angle > 0) {
    const double left = towards(angle, 0, force_N, budget_N);
    slot.normal = turnedBy((left - angle) / angle * slot.turn, slot.normal);
    slot.turn *= left / angle;
  } else {
    slot.turn.setZero();
  }
  if (const double apart = slot.drift_m_per_s.norm(); apart > 0) {
    const double left = towards(apart, 0, force_N > 0 ? slot.damping : 0, budget_N);
    const Vec3 back = (left / apart - 1) * slot.drift_m_per_s;
    slot.drift_m_per_s += back;
    slot.velocity += back;
  } else {
    slot.drift_m_per_s.setZero();  // the norm of the smallest numbers is 0, although they are not
  }
  if (slot.stiffness_N_per_m != c.stiffness_N_per_m) changeStiffness(slot, budget_N);
  const double leaving = slot.normal.dot(hand.velocity_m_per_s - slot.velocity);
  slot.damping = towards(slot.damping, c.damping_Ns_per_m,
                         force_N > 0 ? std::max(std::abs(leaving), kSlow_m_per_s) : 0, budget_N);
  // Both coefficients by the same share: where the client states equal ones, a slip must not find them apart.
  const double staticChange = c.staticFriction - slot.staticFriction;
  const double dynamicChange = c.dynamicFriction - slot.dynamicFriction;
  const double most = std::max(std::abs(staticChange), std::abs(dynamicChange));
  const double share = towards(0, 1, most * slot.normal_N, budget_N);
  slot.staticFriction = share < 1 ? slot.staticFriction + share * staticChange : c.staticFriction;
  slot.dynamicFriction = share < 1 ? slot.dynamicFriction + share * dynamicChange : c.dynamicFriction;
}

// Returns what is left of the budget. A surface that rises against the hand does work on it: unless it
// yields, that work comes from the tank.
double RemoteContacts::takeBackShift(Slot& slot, double budget_N, double step_s) noexcept {
  const RemoteContact& c = slot.contact;
  const double stiffness = slot.stiffness_N_per_m;
  const double before_N = stiffness * slot.depth_m;
  double most_m = std::min({std::abs(slot.shift_m), kRemoteSpeed_m_per_s * step_s, budget_N / stiffness});
  const bool pays = slot.shift_m < 0 && !c.yields;
  const double push_N = before_N + 0.5 * stiffness * most_m;
  if (pays && push_N * most_m > corrections_.energy_J()) {
    held_ = true;
    most_m = corrections_.energy_J() / push_N;
  }
  const double moved_m = std::clamp(-slot.shift_m, -most_m, most_m);
  slot.shift_m += moved_m;
  slot.depth_m += moved_m;
  const double after_N = stiffness * std::max(0.0, slot.depth_m);
  if (!c.yields) settle(slot, 0.5 * (before_N + after_N) * moved_m);
  return std::max(0.0, budget_N - std::abs(after_N - before_N));
}

// A spring that becomes stiffer pushes against the hand: unless it yields, the tank pays.
void RemoteContacts::changeStiffness(Slot& slot, double& budget_N) noexcept {
  const RemoteContact& c = slot.contact;
  const double depth_m = std::max(0.0, slot.depth_m);
  const double half_m2 = 0.5 * depth_m * depth_m;
  const double before = slot.stiffness_N_per_m;
  double after = towards(before, c.stiffness_N_per_m, depth_m, budget_N);
  if (!c.yields) {
    if ((after - before) * half_m2 > corrections_.energy_J()) {
      held_ = true;
      after = before + corrections_.energy_J() / half_m2;
    }
    settle(slot, (after - before) * half_m2);
  }
  slot.stiffness_N_per_m = after;
}

// All at once: nothing is felt of it.
void RemoteContacts::follow(Slot& slot, const RemoteContact& contact) noexcept {
  slot.stiffness_N_per_m = contact.stiffness_N_per_m;
  slot.damping = contact.damping_Ns_per_m;
  slot.staticFriction = contact.staticFriction;
  slot.dynamicFriction = contact.dynamicFriction;
}

// Spring and damper. The damper exerts no more than the spring, so that a touch begins without a step and the
// surface never pulls.
void RemoteContacts::demand(Slot& slot, const RemoteHand& hand) noexcept {
  slot.demand_N = 0;
  if (slot.depth_m <= 0) {
    slot.normal_N = 0;
    return;
  }
  const double spring_N = slot.stiffness_N_per_m * slot.depth_m;
  const double leaving = slot.normal.dot(hand.velocity_m_per_s - slot.velocity);
  const double damper_N = std::clamp(slot.damping * leaving, -spring_N, spring_N);
  slot.demand_N = slot.gain * (spring_N - damper_N);
}

// The normal force of all contacts together, less that of which they relieve the scene. Meshes and planes
// take part as further contacts, so that all forces have one potential.
Vec3 RemoteContacts::share(const RemoteHand& hand) noexcept {
  PressingContacts pressing;
  std::array<Slot*, kSlots> slots;
  for (Slot& slot : inUse()) {
    if (slot.used && slot.demand_N > 0) {
      slots[pressing.count] = &slot;
      pressing.add(slot.normal, slot.stiffness_N_per_m, slot.demand_N, slot.normal_N);
    } else {
      slot.normal_N = 0;
    }
  }
  pressed_N_ = 0;
  if (pressing.count == 0) return Vec3::Zero();
  const std::size_t count = pressing.count;
  pressing.add(hand.scene, hand.scene.exerted);
  shareNormalForce(pressing);
  Vec3 ofScene = -hand.scene.exerted * hand.scene.stiffness_N_per_m * hand.scene.way_m();
  for (std::size_t i = count; i < pressing.count; ++i) ofScene += pressing.share_N[i] * pressing.normal(i);
  Vec3 force = ofScene;
  for (std::size_t i = 0; i < count; ++i) {
    Slot& slot = *slots[i];
    slot.normal_N = pressing.share_N[i];
    slot.grip_N = std::max(0.0, slot.normal_N + std::min(0.0, slot.normal.dot(ofScene)));
    force += slot.normal_N * slot.normal;
    pressed_N_ += slot.normal_N;
  }
  return force;
}

// A spring to a point of the surface, which slides when the spring exceeds the bound.
Vec3 RemoteContacts::friction(Slot& slot, const RemoteHand& hand, double ofAll, double elapsed_s) noexcept {
  if (slot.normal_N <= 0) return Vec3::Zero();
  slot.anchor_m += elapsed_s * slot.velocity;
  Vec3 apart = hand.position_m - slot.anchor_m;
  apart -= slot.normal.dot(apart) * slot.normal;
  const double stiffness = kLateral * slot.stiffness_N_per_m * slot.normal_N / ofAll;
  const double pull = stiffness * apart.norm();
  const double dynamic_N = slot.dynamicFriction * slot.grip_N;
  if (pull > (slot.sliding ? dynamic_N : slot.staticFriction * slot.grip_N)) {
    slot.sliding = true;
    apart *= dynamic_N / pull;
    slot.anchor_m = hand.position_m - apart;
  } else if (pull < kStick * dynamic_N) {
    slot.sliding = false;
  }
  return -stiffness * apart;
}

// A contact that bears nothing yet holds the tool as those that bear: when it comes to bear, the friction of
// all goes on. A softer spring would store more energy at the same force, so it takes over what holds the
// same.
void RemoteContacts::takeHold(Slot& slot, const RemoteHand& hand, const Vec3& friction_N,
                              double energy_J) noexcept {
  const double stiffness = kLateral * slot.stiffness_N_per_m;
  const double most_N = std::sqrt(2 * stiffness * std::max(0.0, energy_J));
  slot.anchor_m = hand.position_m + atMost(friction_N, most_N) / stiffness;
  slot.sliding = false;
}

}  // namespace hapticd::realtime
