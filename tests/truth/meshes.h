// Shapes of random trials, in metres.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "truth/trial.h"

namespace hapticd::truth {

struct Shape {
  std::vector<Point> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;

  void append(const Shape& other);
  void flip(std::size_t triangle);
};

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}

  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(engine_); }
  /// Uniform in the logarithm.
  double logarithmic(double from, double to) { return std::exp(uniform(std::log(from), std::log(to))); }
  int integer(int from, int to) { return std::uniform_int_distribution<int>(from, to)(engine_); }
  bool chance(double p) { return uniform(0, 1) < p; }
  Point direction();
  Point inCube(double half) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }
  Eigen::Quaterniond rotation();
  std::mt19937_64& engine() { return engine_; }

 private:
  std::mt19937_64 engine_;
};

/// The parallelogram origin + [0, 1] u + [0, 1] v in cells, front along u x v; inner vertices move by up to
/// `jitter` cells and diagonals alternate at random.
Shape patch(const Point& origin, const Point& u, const Point& v, int cellsU, int cellsV, double jitter,
            Dice& dice);
/// Six patches, each with cells and a jitter of its own, and shrunk by a gap of up to `gap` at each side.
/// Front inwards.
Shape pocket(const Point& half, int maxCells, double gap, Dice& dice);
Shape box(const Point& centre, const Point& half);
Shape soup(int triangles, double half, double smallest, double largest, Dice& dice);
/// n triangles around an apex, `height` above their rim.
Shape fan(int n, double radius, double height);
/// A square of n strips.
Shape strips(int n, double half, Dice& dice);
/// z = f(x, y) over [-half, half]^2, bumps of random waves.
Shape bumps(int cells, double half, double amplitude, double jitter, Dice& dice);
/// An octahedron, each side in n x n, with random radii.
Shape sphere(int n, double radius, double roughness, Dice& dice);

void transform(Shape& shape, const Eigen::Quaterniond& rotation, const Point& offset);

/// The object whose placement puts its vertices, rounded to floats, where the shape's are.
TrialObject bake(const Shape& shape, const Pose& pose);

}  // namespace hapticd::truth
