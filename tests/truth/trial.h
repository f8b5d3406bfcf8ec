// A scene and the path of a hand as plain numbers: what the referee judges, the shrinker reduces, and a file
// holds.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

namespace hapticd::truth {

using Point = Eigen::Vector3d;
using Corner = Eigen::Vector3f;

inline constexpr int kPoseTicks = 16;  ///< between two poses of a stream: 60 Hz
inline constexpr double kPeriod_s = 1e-3;

/// Device metres from object units: position + rotation * (scale . x).
struct Pose {
  Point position_m = Point::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Point scale = Point::Ones();
};

struct Material {
  double stiffness_N_per_m = 1000;
  double damping_Ns_per_m = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;
  double popthrough_N = 0;
};

struct TrialObject {
  std::vector<Corner> vertices;  ///< object units
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<Corner> target;  ///< of the vertices, between two ticks; empty: rigid
  int morphBegin = 0;
  int morphEnd = 0;
  Material material;
  std::vector<Pose> poses{Pose{}};  ///< pose k at tick k * kPoseTicks, interpolated; the last one remains

  bool moves() const { return poses.size() > 1; }
};

/// Solid where normal . x + offset_m < 0; device metres.
struct TrialPlane {
  Point normal = Point::UnitY();
  double offset_m = 0;
  Material material;
};

/// normal . x <= offset_m; device metres.
struct Wall {
  Point normal = Point::UnitY();
  double offset_m = 0;
};

enum class Sides { front, back, both };

struct Trial {
  std::uint64_t seed = 0;
  std::string kind;  ///< of the scene
  double worldUnitsPerMetre = 1000;
  double toolRadius_m = 0;
  Sides sides = Sides::both;
  std::vector<TrialObject> objects;
  std::vector<TrialPlane> planes;
  std::vector<Wall> enclosure;  ///< the proxy must stay within these; empty: not enclosed
  std::vector<Point> hips;      ///< one for each tick, device metres

  bool isStatic() const;
  std::size_t triangleCount() const;
};

/// As text with all digits.
void write(std::ostream& out, const Trial& trial);
/// Throws std::runtime_error with the line that is wrong.
Trial read(std::istream& in);

}  // namespace hapticd::truth
