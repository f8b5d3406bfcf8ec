// Matrices as clients send them, checked.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "geometry/types.h"

namespace hapticd::scene {

using geometry::Affine;
using geometry::Mat3;
using geometry::Mat4;
using geometry::Vec3;

/// Larger numbers are taken for mistakes: their squares would soon not be numbers.
inline constexpr double kLargest = 1e30;

/// Finite, and not larger than kLargest.
inline bool isUsable(double value) {
  return std::abs(value) <= kLargest;
}
inline bool isUsable(const Vec3& v) {
  return (v.array().abs() <= kLargest).all();
}

/// The length, also of vectors whose squares are not numbers. Eigen's stableNorm() adds in an order that
/// depends on the address, so that one command would not always make the same scene.
double lengthOf(const Vec3& v);

/// Column-major, as OpenGL keeps them.
Mat4 fromColumns(const std::array<double, 16>& m);
/// Row-major.
Mat4 fromRows(const std::array<float, 16>& m);

/// Usable numbers, and far enough from singular to be inverted.
bool isInvertible(const Affine& t);

/// The first number that is not finite or too large, and its place, for a text to the sender; empty without
/// one.
std::string unusableNumberOf(const Mat4& m);

/// The affine map a 4x4 matrix stands for; nothing when it is projective, singular or not finite. `flaw` is
/// then what makes it so, for a text to its sender: a number, the last row or the determinant.
std::optional<Affine> affineFrom(const Mat4& m, std::string& flaw);

/// Rotation about an axis of any length; nothing when there is no axis although there is an angle.
std::optional<geometry::Quat> rotationFrom(const Vec3& axis, double angle_rad);

}  // namespace hapticd::scene
