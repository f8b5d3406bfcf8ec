#include "realtime/remote/remote_contacts.h"

#include <cmath>

#include "base/time.h"

namespace hapticd::realtime {
namespace {

// Of the 0.3 N/ms. One contact leaves a rest for friction, which follows the normal force. Several share
// less, because in a corner the force changes faster than what each face demands; a fade and corrections
// share it, too.
constexpr double kCorrection_N_per_s = 0.8 * kRemoteRate_N_per_s;
constexpr double kShared_N_per_s = 0.45 * kRemoteRate_N_per_s;
constexpr double kFade_N_per_s = 0.4 * kRemoteRate_N_per_s;
constexpr double kBesideFade_N_per_s = 0.25 * kRemoteRate_N_per_s;
constexpr double kLongestAge_s = 0.2;  // a surface moves on no longer than this without an update
constexpr int kSweeps = 40;
constexpr double kConverged_N = 1e-6;
constexpr double kLateral = 0.5;        // share of the stiffness that holds a sticking point
constexpr double kStick = 0.9;          // of the dynamic bound: sliding ends below it
constexpr double kSlow_m_per_s = 0.01;  // below it the damping coefficient may change as at this speed

Vec3 rotatedBy(const Vec3& rotation, const Vec3& v) noexcept {
  const double square = rotation.squaredNorm();
  if (square < 1e-24) return v;
  const double angle = std::sqrt(square);
  const Vec3 axis = rotation / angle;
  const double cosine = std::cos(angle);
  return cosine * v + std::sin(angle) * axis.cross(v) + (1 - cosine) * axis.dot(v) * axis;
}

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
  pressed_N = 0;
}

Vec3 RemoteContacts::step(const RemoteContactSet& newest, const RemoteHand& hand, Nanos now, double step_s,
                          RemoteRendering& out) noexcept {
  out.contactsTime = newest.clientTime;
  corrections_.refill(step_s);
  if (newest.number != taken_) take(newest, hand, now);
  if (top_ == 0) return Vec3::Zero();
  fadeOut(now, step_s);

  int changing = 0;
  bool fading = resumed_;
  resumed_ = false;
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    locate(slot, hand, now);
    changing += slot.fade == 0 && (slot.demand_N > 0 || slot.depth_m > slot.shift_m);
    fading = fading || (slot.fade > 0 && slot.demand_N > 0);
  }
  const double budget_N = (fading         ? kBesideFade_N_per_s
                           : changing > 1 ? kShared_N_per_s
                                          : kCorrection_N_per_s) *
                          step_s / std::max(changing, 1);
  held_ = false;
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    if (slot.fade == 0) correct(slot, hand, budget_N, step_s);
    demand(slot, hand, now);
  }
  Vec3 force = share(hand);
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    const Vec3 tangential = friction(slot, hand, pressed_N, step_s);
    force += tangential;
    if (slot.normal_N <= 0 || out.count == kMaxRemoteContacts) continue;
    out.contacts[out.count++] = {
        slot.contact.id, (hand.position_m + slot.depth_m * slot.normal).cast<float>(),
        (slot.normal_N * slot.normal + tangential).cast<float>(), static_cast<float>(slot.depth_m)};
  }
  if (held_) out.status |= kRemoteCorrectionsHeld;
  out.contactForce_N = force;
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
  for (Slot& slot : inUse()) {
    if (!slot.used || slot.stated || slot.fade > 0) continue;
    const Nanos length = std::max<Nanos>(base::toNanos(leaving_N / kFade_N_per_s), 1);
    slot.end = std::min(slot.end, now + length);
    slot.fade = std::max<Nanos>(slot.end - now, 1);
  }
}

// The surface jumps where the client says, and shift and turn keep spring force and normal of the moment.
void RemoteContacts::replace(Slot& slot, const RemoteContact& contact, const RemoteContactSet& set,
                             const RemoteHand& hand, Nanos now) noexcept {
  const bool known = slot.used;
  const double stiffness = slot.contact.stiffness_N_per_m;
  double spring_N = 0;
  Vec3 normal = contact.normal;
  if (known) {
    locate(slot, hand, now);
    resumed_ = resumed_ || slot.fade > 0;
    spring_N = gain(slot, now) * slot.contact.stiffness_N_per_m * std::max(0.0, slot.depth_m);
    normal = slot.normal;
  } else {
    slot = Slot{};
    slot.used = true;
    slot.damping = contact.damping_Ns_per_m;
    slot.staticFriction = contact.staticFriction;
    slot.dynamicFriction = contact.dynamicFriction;
    slot.anchor_m = hand.position_m;
  }
  slot.stated = true;
  slot.contact = contact;
  slot.statedAt = set.stated;
  slot.end = set.received + contact.lifetime;
  slot.fade = 0;
  slot.shift_m = 0;
  slot.turn.setZero();
  locate(slot, hand, now);
  if (!known) slot.velocity = slot.stated_m_per_s;
  if (spring_N <= 0) {
    slot.shift_m = std::min(0.0, -slot.depth_m);
  } else {
    slot.shift_m = spring_N / contact.stiffness_N_per_m - slot.depth_m;
    slot.anchor_m =
        hand.position_m + stiffness / contact.stiffness_N_per_m * (slot.anchor_m - hand.position_m);
    slot.turn = rotationVector(slot.normal, normal);
  }
}

// The fade of all contacts that end together takes the time in which their force may fall.
void RemoteContacts::fadeOut(Nanos now, double step_s) noexcept {
  const Nanos needed = base::toNanos(pressed_N / kFade_N_per_s + step_s);
  std::size_t top = 0;
  for (Slot& slot : inUse()) {
    if (!slot.used) continue;
    const Nanos left = slot.end - now;
    if (left <= 0) {
      slot.used = false;
    } else if (slot.fade == 0 && left <= needed) {
      slot.fade = left;
    }
    if (slot.used) top = static_cast<std::size_t>(&slot - slots_.data()) + 1;
  }
  top_ = top;
}

double RemoteContacts::gain(const Slot& slot, Nanos now) noexcept {
  if (slot.fade == 0) return 1;
  return std::clamp(static_cast<double>(slot.end - now) / static_cast<double>(slot.fade), 0.0, 1.0);
}

void RemoteContacts::locate(Slot& slot, const RemoteHand& hand, Nanos now) noexcept {
  const double age_s = std::clamp(base::toSeconds(now - slot.statedAt), 0.0, kLongestAge_s);
  const SurfaceAt at = surfaceAt(slot.contact, age_s, hand.position_m);
  slot.depth_m = at.depth_m + slot.shift_m;
  slot.stated_m_per_s = slot.contact.velocity_m_per_s;
  if (!slot.contact.angularVelocity_rad_per_s.isZero(0)) {
    slot.stated_m_per_s += slot.contact.angularVelocity_rad_per_s.cross(hand.position_m - at.point_m);
    const double speed = slot.stated_m_per_s.norm();
    if (speed > kRemoteSpeed_m_per_s) slot.stated_m_per_s *= kRemoteSpeed_m_per_s / speed;
  }
  slot.normal = rotatedBy(slot.turn, at.normal);
}

// Takes back shift and turn and lets velocity, damping and friction follow, together within the budget. A
// surface that rises against the hand does work on it: unless it yields, that work comes from the tank.
void RemoteContacts::correct(Slot& slot, const RemoteHand& hand, double budget_N, double step_s) noexcept {
  const RemoteContact& c = slot.contact;
  if (slot.depth_m - slot.shift_m <= 0 && slot.depth_m <= 0) {  // untouched: nothing can be felt
    slot.depth_m -= slot.shift_m;
    slot.shift_m = 0;
    slot.turn.setZero();
    slot.velocity = slot.stated_m_per_s;
    slot.damping = c.damping_Ns_per_m;
    slot.staticFriction = c.staticFriction;
    slot.dynamicFriction = c.dynamicFriction;
    return;
  }
  budget_N /= 1 + slot.staticFriction;
  if (slot.shift_m != 0 && slot.depth_m <= 0) {  // free: up to the HIP at once
    const double stated_m = slot.depth_m - slot.shift_m;
    slot.shift_m = std::min(0.0, -stated_m);
    slot.depth_m = stated_m + slot.shift_m;
  }
  if (slot.shift_m != 0) {
    const double before_N = c.stiffness_N_per_m * slot.depth_m;
    double most_m =
        std::min({std::abs(slot.shift_m), kRemoteSpeed_m_per_s * step_s, budget_N / c.stiffness_N_per_m});
    const bool pays = slot.shift_m < 0 && !c.yields;
    const double push_N = before_N + 0.5 * c.stiffness_N_per_m * most_m;
    if (pays && push_N * most_m > corrections_.energy_J()) {
      held_ = true;
      most_m = corrections_.energy_J() / push_N;
    }
    const double moved_m = std::clamp(-slot.shift_m, -most_m, most_m);
    slot.shift_m += moved_m;
    slot.depth_m += moved_m;
    const double after_N = c.stiffness_N_per_m * std::max(0.0, slot.depth_m);
    if (!c.yields) corrections_.give(0.5 * (before_N + after_N) * moved_m);
    budget_N = std::max(0.0, budget_N - std::abs(after_N - before_N));
  }
  const double force_N = slot.demand_N;
  const double angle = slot.turn.norm();
  if (angle > 0) {
    const double left = towards(angle, 0, force_N, budget_N);
    slot.normal = rotatedBy((left - angle) / angle * slot.turn, slot.normal);
    slot.turn *= left / angle;
  }
  const Vec3& stated = slot.stated_m_per_s;
  const double apart = (stated - slot.velocity).norm();
  if (apart > 0) {
    const double left = towards(apart, 0, force_N > 0 ? slot.damping : 0, budget_N);
    slot.velocity = stated + left / apart * (slot.velocity - stated);
  }
  const double leaving = slot.normal.dot(hand.velocity_m_per_s - slot.velocity);
  slot.damping = towards(slot.damping, c.damping_Ns_per_m,
                         force_N > 0 ? std::max(std::abs(leaving), kSlow_m_per_s) : 0, budget_N);
  slot.staticFriction = towards(slot.staticFriction, c.staticFriction, slot.normal_N, budget_N);
  slot.dynamicFriction = towards(slot.dynamicFriction, c.dynamicFriction, slot.normal_N, budget_N);
}

// Spring and damper. The damper exerts no more than the spring, so that a touch begins without a step and the
// surface never pulls.
void RemoteContacts::demand(Slot& slot, const RemoteHand& hand, Nanos now) noexcept {
  slot.demand_N = 0;
  if (slot.depth_m <= 0) {
    slot.normal_N = 0;
    return;
  }
  const double spring_N = slot.contact.stiffness_N_per_m * slot.depth_m;
  const double leaving = slot.normal.dot(hand.velocity_m_per_s - slot.velocity);
  const double damper_N = std::clamp(slot.damping * leaving, -spring_N, spring_N);
  slot.demand_N = gain(slot, now) * (spring_N - damper_N);
}

// Each contact adds what the others do not already exert along its normal, so that surfaces on top of each
// other are as stiff as one, and surfaces across each other add up.
Vec3 RemoteContacts::share(const RemoteHand& hand) noexcept {
  std::array<Slot*, kSlots> active;
  std::size_t count = 0;
  for (Slot& slot : inUse()) {
    if (slot.used && slot.demand_N > 0) {
      active[count++] = &slot;
    } else {
      slot.normal_N = 0;
    }
  }
  pressed_N = 0;
  Vec3 force = Vec3::Zero();
  if (count == 0) return force;
  std::array<double, kSlots> wanted;
  std::array<std::array<double, kSlots>, kSlots> overlap;
  for (std::size_t i = 0; i < count; ++i) {
    wanted[i] = active[i]->demand_N - std::max(0.0, active[i]->normal.dot(hand.sceneForce_N));
    for (std::size_t j = 0; j < i; ++j)
      overlap[i][j] = overlap[j][i] = std::max(0.0, active[i]->normal.dot(active[j]->normal));
  }
  // The shares of the last tick are nearly those of this one.
  double change = kConverged_N;
  for (int sweep = 0; sweep < kSweeps && change >= kConverged_N; ++sweep) {
    change = 0;
    for (std::size_t i = 0; i < count; ++i) {
      double rest = wanted[i];
      for (std::size_t j = 0; j < count; ++j) {
        if (j != i) rest -= overlap[i][j] * active[j]->normal_N;
      }
      rest = std::max(0.0, rest);
      change = std::max(change, std::abs(rest - active[i]->normal_N));
      active[i]->normal_N = rest;
    }
    if (count == 1) break;
  }
  for (std::size_t i = 0; i < count; ++i) {
    force += active[i]->normal_N * active[i]->normal;
    pressed_N += active[i]->normal_N;
  }
  return force;
}

// A spring to a point of the surface, which slides when the spring exceeds the bound.
Vec3 RemoteContacts::friction(Slot& slot, const RemoteHand& hand, double ofAll, double step_s) noexcept {
  if (slot.normal_N <= 0 || slot.staticFriction <= 0) {
    slot.anchor_m = hand.position_m;
    slot.sliding = false;
    return Vec3::Zero();
  }
  slot.anchor_m += step_s * slot.velocity;
  Vec3 apart = hand.position_m - slot.anchor_m;
  apart -= slot.normal.dot(apart) * slot.normal;
  const double stiffness = kLateral * slot.contact.stiffness_N_per_m * slot.normal_N / ofAll;
  const double pull = stiffness * apart.norm();
  const double dynamic_N = slot.dynamicFriction * slot.normal_N;
  if (pull > (slot.sliding ? dynamic_N : slot.staticFriction * slot.normal_N)) {
    slot.sliding = true;
    apart *= dynamic_N / pull;
    slot.anchor_m = hand.position_m - apart;
  } else if (pull < kStick * dynamic_N) {
    slot.sliding = false;
  }
  return -stiffness * apart;
}

}  // namespace hapticd::realtime
