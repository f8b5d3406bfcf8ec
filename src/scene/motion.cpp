#include "scene/motion.h"

#include <cmath>

namespace hapticd::scene {
namespace {

using geometry::Mat3;

// Orthogonal factor of the polar decomposition by Newton's iteration with determinant scaling
// (Higham 1986); a few 3x3 inverses, an order faster than a singular value decomposition.
Mat3 orthogonalFactor(const Mat3& m) {
  Mat3 q = m;
  for (int i = 0; i < 64; ++i) {
    const double scale = std::cbrt(1.0 / std::abs(q.determinant()));
    const Mat3 scaled = scale * q;
    const Mat3 next = 0.5 * (scaled + scaled.inverse().transpose());
    const double change = (next - q).cwiseAbs().maxCoeff();
    q = next;
    if (!(change > 1e-14)) break;
  }
  return q;
}

}  // namespace

// A reflection has no rotation of its own: its sign goes into the stretch, which then stays negative definite
// all the way between two reflected placements, so that neither kind passes through a singular one.
Motion::Factors Motion::factorise(const Affine& t) {
  Mat3 rotation = orthogonalFactor(t.linear());
  if (rotation.determinant() < 0) rotation = -rotation;
  Factors f;
  f.rotation = geometry::Quat(rotation).normalized();
  const Mat3 stretch = f.rotation.toRotationMatrix().transpose() * t.linear();
  f.stretch = 0.5 * (stretch + stretch.transpose());
  return f;
}

Motion Motion::fixed(const Affine& T_world_object, std::uint32_t jumps) {
  Motion motion;
  motion.from_ = T_world_object;
  motion.to_ = T_world_object;
  motion.jumps_ = jumps;
  return motion;
}

Motion Motion::between(const Affine& from, const Affine& to, Nanos begin, Nanos end, std::uint32_t jumps) {
  Motion motion;
  motion.from_ = from;
  motion.to_ = to;
  motion.fromFactors_ = factorise(from);
  motion.toFactors_ = factorise(to);
  motion.begin_ = begin;
  motion.end_ = end;
  motion.jumps_ = jumps;
  return motion;
}

Affine Motion::at(Nanos now) const noexcept {
  if (now >= end_) return to_;
  if (now <= begin_) return from_;
  const double s = static_cast<double>(now - begin_) / static_cast<double>(end_ - begin_);
  const geometry::Mat3 stretch = (1 - s) * fromFactors_.stretch + s * toFactors_.stretch;
  Affine t;
  t.linear() = fromFactors_.rotation.slerp(s, toFactors_.rotation).toRotationMatrix() * stretch;
  t.translation() = (1 - s) * from_.translation() + s * to_.translation();
  return t;
}

}  // namespace hapticd::scene
