#include "scene/motion.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::scene {
namespace {

using geometry::Mat3;

// Orthogonal factor of the polar decomposition by Newton's iteration with determinant scaling
// (Higham 1986); a few 3x3 inverses, an order faster than a singular value decomposition.
Mat3 orthogonalFactor(const Mat3& m) {
  const Mat3 square = m.transpose() * m;
  const double scale2 = square.trace() / 3;
  // What most clients send: a rotation with one scale.
  if ((square - scale2 * Mat3::Identity()).cwiseAbs().maxCoeff() < 1e-14 * scale2)
    return m / std::sqrt(scale2);
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

// What is only carried needs no factors: most objects, most of the time.
bool sameLinear(const Affine& a, const Affine& b) {
  return a.linear() == b.linear();
}

geometry::Box transformed(const Affine& t, const geometry::Box& box) {
  const geometry::Vec3 centre = t * box.centre();
  const geometry::Vec3 half = t.linear().cwiseAbs() * (0.5 * box.extents());
  return {centre - half, centre + half};
}

}  // namespace

// A reflection is no rotation: its sign moves into the stretch, which then stays negative definite
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
  motion.before_ = motion.from_ = T_world_object;
  motion.to_ = T_world_object;
  motion.jumps_ = jumps;
  return motion;
}

Motion Motion::between(const Affine& from, const Affine& to, Nanos begin, Nanos end, std::uint32_t jumps) {
  Motion motion;
  motion.before_ = motion.from_ = from;
  motion.to_ = to;
  if (!sameLinear(from, to)) {
    motion.fromFactors_ = factorise(from);
    motion.toFactors_ = factorise(to);
    motion.frameFrom_ = from.translation();
    motion.frameTo_ = to.translation();
  }
  motion.begin_ = begin;
  motion.end_ = end;
  motion.jumps_ = jumps;
  return motion;
}

Motion& Motion::with(const Motion& leader) noexcept {
  if (sameLinear(from_, to_) || sameLinear(leader.from_, leader.to_)) return *this;
  led_ = true;
  T_leader_object_ = leader.from_.inverse() * from_;
  fromFactors_ = leader.fromFactors_;
  toFactors_ = leader.toFactors_;
  frameFrom_ = leader.frameFrom_;
  frameTo_ = leader.frameTo_;
  return *this;
}

Affine Motion::at(Nanos now) const noexcept {
  if (now >= end_) return to_;
  if (now <= begin_) return from_;
  return atShare(static_cast<double>(now - begin_) / static_cast<double>(end_ - begin_));
}

Affine Motion::atShare(double s) const noexcept {
  Affine t;
  if (sameLinear(from_, to_)) {
    t.linear() = from_.linear();
    t.translation() = (1 - s) * from_.translation() + s * to_.translation();
    return t;
  }
  const geometry::Mat3 stretch = (1 - s) * fromFactors_.stretch + s * toFactors_.stretch;
  t.linear() = fromFactors_.rotation.slerp(s, toFactors_.rotation).toRotationMatrix() * stretch;
  t.translation() = (1 - s) * frameFrom_ + s * frameTo_;
  return led_ ? t * T_leader_object_ : t;
}

// The difference of two placements is affine in the point, so that its length is largest at a corner.
double longestMove(const Affine& from, const Affine& to, const geometry::Box& box) noexcept {
  double longest2 = 0;
  for (int i = 0; i < 8; ++i) {
    const geometry::Vec3 p((i & 1) != 0 ? box.max.x() : box.min.x(), (i & 2) != 0 ? box.max.y() : box.min.y(),
                           (i & 4) != 0 ? box.max.z() : box.min.z());
    longest2 = std::max(longest2, (to * p - from * p).squaredNorm());
  }
  return std::sqrt(longest2);
}

// Seen from the object, the centre travels.
geometry::Box partNear(const geometry::Box& box, std::span<const Affine> placements,
                       const geometry::Vec3& centre, double reach) noexcept {
  geometry::Box near;
  for (const Affine& placement : placements) {
    const Affine toObject = placement.inverse();
    const geometry::Vec3 half = reach * toObject.linear().rowwise().norm();
    const geometry::Vec3 middle = toObject * centre;
    near.extend(geometry::Box{middle - half, middle + half});
  }
  near.min = near.min.cwiseMax(box.min);
  near.max = near.max.cwiseMin(box.max);
  return near;
}

// The centre travels on a straight line when the linear part stays; otherwise the box around a few of its
// places covers the curve between them.
double Motion::longestMoveNear(const geometry::Box& box, const geometry::Vec3& centre,
                               double reach) const noexcept {
  if (box.empty()) return 0;
  std::array<Affine, 5> places;
  const std::size_t samples = sameLinear(from_, to_) ? 2 : places.size();
  for (std::size_t i = 0; i < samples; ++i)
    places[i] = atShare(static_cast<double>(i) / static_cast<double>(samples - 1));
  const geometry::Box near = partNear(box, std::span(places.data(), samples), centre, reach);
  return near.empty() ? 0 : longestMove(before_, to_, near);
}

// A path x(s) leaves its chord by at most max|x''|/8. Here x = R(s) S(s) p + t(s) with |R'| = θ, |R''| = θ²
// and S, t linear, so x'' = R'' S p + 2 R' S' p.
geometry::Box Motion::sweep(const geometry::Box& box) const {
  if (box.empty()) return {};
  geometry::Box swept = transformed(to_, box);
  if (end_ <= begin_) return swept;
  swept.extend(transformed(from_, box));
  if (sameLinear(from_, to_)) return swept;
  const double angle = fromFactors_.rotation.angularDistance(toFactors_.rotation);
  double leave = 0;
  for (int i = 0; i < 8; ++i) {
    const geometry::Vec3 p((i & 1) != 0 ? box.max.x() : box.min.x(), (i & 2) != 0 ? box.max.y() : box.min.y(),
                           (i & 4) != 0 ? box.max.z() : box.min.z());
    const geometry::Vec3 inFrame = T_leader_object_ * p;
    const geometry::Vec3 a = fromFactors_.stretch * inFrame;
    const geometry::Vec3 b = toFactors_.stretch * inFrame;
    leave = std::max(leave, angle * angle * std::max(a.norm(), b.norm()) + 2 * angle * (b - a).norm());
  }
  swept.min.array() -= leave / 8;
  swept.max.array() += leave / 8;
  return swept;
}

// As in sweep(); each term is convex in the point.
double Motion::detour(const geometry::Vec3& centre, double radius) const noexcept {
  if (end_ <= begin_ || sameLinear(from_, to_)) return 0;
  const double angle = fromFactors_.rotation.angularDistance(toFactors_.rotation);
  const geometry::Vec3 inFrame = T_leader_object_ * centre;
  const double reach = radius * T_leader_object_.linear().norm();
  const auto longest = [&](const Mat3& m) { return (m * inFrame).norm() + m.norm() * reach; };
  const double stretched = std::max(longest(fromFactors_.stretch), longest(toFactors_.stretch));
  return (angle * angle * stretched + 2 * angle * longest(toFactors_.stretch - fromFactors_.stretch)) / 8;
}

}  // namespace hapticd::scene
