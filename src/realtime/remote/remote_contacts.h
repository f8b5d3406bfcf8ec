// The law of remote contacts: surfaces that a client streams, rendered at the servo's rate.
//
// A surface moves by its stated velocities. An update that says otherwise never moves it at once: the law
// keeps the force of the moment, by shifting and turning the surface, and takes shift and turn back at a
// limited rate. docs/remote-contacts.md derives it.
#pragma once

#include <span>

#include "realtime/remote/energy_tank.h"
#include "realtime/remote/remote_memory.h"
#include "realtime/remote/remote_report.h"
#include "realtime/remote/remote_shape.h"
#include "realtime/render/pressed_faces.h"

namespace hapticd::realtime {

/// The hand in one tick. Device frame.
struct RemoteHand {
  Vec3 position_m = Vec3::Zero();
  Vec3 velocity_m_per_s = Vec3::Zero();
  PressedFaces scene;  ///< meshes and planes, with which remote contacts share the normal force
};

/// The springs of remote contacts in one tick, without their dampers. All zero while nothing is touched.
struct RemoteSprings {
  Vec3 force_N = Vec3::Zero();
  Vec3 normal_N = Vec3::Zero();  ///< the part without friction
  double stored_J = 0;
  double stiffest_N_per_m = 0;
  bool beside = false;  ///< the scene is touched, too: all is what they add to it
};

/// One per servo, called in its thread: noexcept, no allocation.
class RemoteContacts {
 public:
  /// One tick; in `step_s`, which is no more than two periods, updates change the force. Returns what they
  /// add to the force of the scene on the hand; `out` gets the contacts that exert it.
  Vec3 step(const RemoteContactSet& newest, const RemoteHand& hand, Nanos now, double step_s,
            RemoteRendering& out) noexcept;
  /// Before step(): the view moved all that is stated, and the hand in the last tick, on the device.
  void moveWithView(const geometry::Affine& motion) noexcept;
  /// Of the last tick.
  RemoteSprings springs() const noexcept;
  /// In the last tick, no touched surface moved, changed or faded, those of the scene included.
  bool rest() const noexcept { return rest_; }
  /// Forgets all contacts at once.
  void reset() noexcept;
  /// The hand may be anywhere: the same, and what was stated up to the set `number` does not count any more.
  void restart(std::uint64_t number) noexcept;
  /// What later contacts depend on, unless there are some: then false.
  bool remember(RemoteMemory& out) const noexcept;
  /// Continues from a tick without contacts, with the hand at `hip_m`.
  void resume(const RemoteMemory& memory, const Vec3& hip_m) noexcept;

 private:
  // Those of the newest set, and as many that fade out.
  static constexpr std::size_t kSlots = 2 * kMaxRemoteContacts;

  // What a tick changes, and may try again.
  struct Rendered {
    double shift_m = 0;                 // of the rendered surface, out of the material
    Vec3 turn = Vec3::Zero();           // rotation vector from the stated to the rendered normal
    Vec3 drift_m_per_s = Vec3::Zero();  // rendered velocity of the surface less the stated one
    double stiffness_N_per_m = 0;
    double damping = 0;
    double staticFriction = 0;
    double dynamicFriction = 0;
    Vec3 anchor_m = Vec3::Zero();
    bool sliding = false;
    double gain = 1;  // falls to 0 in a fade

    // Of this tick.
    Vec3 velocity = Vec3::Zero();  // of the surface at the HIP, for damper and friction
    double depth_m = 0;
    Vec3 normal = Vec3::UnitY();
    double demand_N = 0;  // normal force that this contact alone would exert
    double normal_N = 0;  // its share of the normal force of all
    double grip_N = 0;    // of that, what the scene does not hold by friction already
    Vec3 friction_N = Vec3::Zero();
  };

  struct Slot : Rendered {
    bool used = false;
    bool stated = false;  // in the newest set
    RemoteContact contact;
    Nanos statedAt = 0;
    Nanos end = 0;  // of its life
    bool fading = false;
    Nanos fadeEnd = 0;    // at most `end`
    double fadeStep = 0;  // by which the gain falls in this tick
  };

  void take(const RemoteContactSet& set, const RemoteHand& hand, Nanos now) noexcept;
  void replace(Slot& slot, const RemoteContact& contact, const RemoteContactSet& set, const RemoteHand& hand,
               Nanos now) noexcept;
  void giveBack(const Slot& slot, double energy_J) noexcept;
  void settle(const Slot& slot, double work_J) noexcept;
  std::span<Slot> inUse() noexcept { return {slots_.data(), top_}; }
  Slot* slotFor(std::int32_t id) noexcept;
  // What a tick changes besides following the hand and the stated motion.
  struct Change {
    double correction_N = 0;  // for each contact
    double fade = 0;          // share of the fade steps
  };
  // Of one tick, which may be tried again with smaller changes.
  struct Tried {
    std::array<Rendered, kSlots> rendered;
    EnergyTank corrections{EnergyBudget{}};
  };
  Vec3 forceWith(const Change& change, const RemoteHand& hand, double step_s) noexcept;
  Vec3 forceAgain(const Change& change, const RemoteHand& hand, double step_s) noexcept;
  Vec3 forceWithin(const Change& most, double most_N, const RemoteHand& hand, double step_s) noexcept;
  void report(const RemoteHand& hand, RemoteRendering& out) noexcept;
  void fadeOut(Nanos now, double step_s) noexcept;
  static void locate(Slot& slot, const RemoteHand& hand, Nanos now) noexcept;
  static bool isCorrected(const Slot& slot) noexcept;
  static bool hardlyChanges(const Slot& slot, double step_s) noexcept;
  void correct(Slot& slot, const RemoteHand& hand, double budget_N, double step_s) noexcept;
  double takeBackShift(Slot& slot, double budget_N, double step_s) noexcept;
  void changeStiffness(Slot& slot, double& budget_N) noexcept;
  static void follow(Slot& slot, const RemoteContact& contact) noexcept;
  static void demand(Slot& slot, const RemoteHand& hand) noexcept;
  Vec3 share(const RemoteHand& hand) noexcept;
  static Vec3 friction(Slot& slot, const RemoteHand& hand, double ofAll, double elapsed_s) noexcept;
  Vec3 limitFriction(const RemoteHand& hand, double given_J) noexcept;
  static void takeHold(Slot& slot, const RemoteHand& hand, const Vec3& friction_N, double energy_J) noexcept;

  std::array<Slot, kSlots> slots_;
  std::uint64_t taken_ = 0;
  std::size_t top_ = 0;          // slots from here on are unused
  double due_N_ = 0;             // what fades must take in this tick to end in time
  bool resumed_ = false;         // an update came during a fade
  Tried before_;                 // before this tick's corrections, where there are some
  Vec3 force_N_ = Vec3::Zero();  // of the last tick, with what it left
  Vec3 late_N_ = Vec3::Zero();   // part of a jump that this tick leaves to the next
  PressedFaces scene_;           // in the last tick
  double pressed_N_ = 0;         // sum of the normal forces in the last tick
  Vec3 hand_m_ = Vec3::Zero();   // in the last tick
  double frictionEnergy_J_ = 0;  // which the hand gave to the springs of friction, at the last tick
  double frictionNow_J_ = 0;     // at this one
  EnergyTank corrections_{EnergyBudget{}};
  Nanos lastTick_ = 0;    // 0: none
  double elapsed_s_ = 0;  // since then: surfaces move on through a late tick
  bool held_ = false;     // a correction waited for energy in this tick
  bool rest_ = true;
  bool viewMoved_ = false;  // since the last tick
};

}  // namespace hapticd::realtime
