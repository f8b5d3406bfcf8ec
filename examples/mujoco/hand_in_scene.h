// A hand in a MuJoCo scene: the surfaces near it go to the server, the forces on it come back onto the
// bodies. The scene is MJCF in metres, z up; everything here is in the server's frame, y up. It needs a body
// "hand" with a free joint and a geom "tool" whose gap exceeds its margin.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hapticd/remote.h"
#include "hapticd/reports.h"

struct mjModel_;
struct mjData_;

namespace mujoco_example {

struct Waypoint {
  double time_s = 0;
  std::array<double, 3> position_m{};
};

class HandInScene {
 public:
  /// Loads a file. Throws std::runtime_error with MuJoCo's text.
  explicit HandInScene(const std::string& file);
  ~HandInScene();

  /// Where the simulated hand is led, from the scene's custom numeric "path".
  const std::vector<Waypoint>& path() const { return path_; }
  /// The place on the path; it repeats.
  std::array<double, 3> placeAt(double time_s) const;

  /// All bodies back to their first places.
  void reset();
  /// The hand as last reported.
  void setHand(const std::array<double, 3>& position_m, const std::array<double, 3>& velocity_m_per_s);
  /// The forces on the hand that the last tick rendered; the bodies receive the opposite until the next call.
  void setForces(const std::vector<hapticd::RemoteContactForce>& forces);
  /// Advances the simulation by whole time steps.
  void step(double seconds);
  /// The surfaces within the tool's margin, nearest first, at most 16.
  std::vector<hapticd::RemoteContact> surfaces();

  /// The scene as it is now, drawn as SVG, with the forces on the bodies.
  std::string picture() const;

 private:
  struct Push {
    int body = 0;
    std::array<double, 3> point{};  ///< MuJoCo's frame
    std::array<double, 3> force{};
  };

  int numberOf(int geom, const std::array<double, 3>& face,
               const std::map<int, std::array<double, 3>>& taken) const;

  std::unique_ptr<mjModel_, void (*)(mjModel_*)> model_;
  std::unique_ptr<mjData_, void (*)(mjData_*)> data_;
  int tool_ = -1;  ///< geom
  int handQpos_ = 0, handQvel_ = 0;
  std::array<double, 3> hand_{};  ///< MuJoCo's frame, as the next two
  std::array<double, 3> velocity_{};
  std::map<int, Push> touched_;                 ///< by id of a surface: where a force acts
  std::map<int, std::array<double, 3>> faces_;  ///< by id of a surface: its normal in the frame of its geom
  std::vector<Push> pushes_;
  std::vector<Waypoint> path_;
};

}  // namespace mujoco_example
