#include "scene/workspace_fit.h"

#include <Eigen/SVD>
#include <cmath>
#include <utility>

#include "scene/matrices.h"
#include "scene/notice.h"

namespace hapticd::scene {
namespace {

using geometry::Box;
using geometry::Mat3;
using geometry::Mat4;
using geometry::Vec3;

// Rotation and uniform scale nearest to a matrix (Umeyama 1991, without the translation).
Mat3 nearestSimilarity(const Mat3& m) {
  const Eigen::JacobiSVD<Mat3> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vec3 sign = Vec3::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
  const double scale = svd.singularValues().dot(sign) / 3;
  return scale * svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

// Clients keep their matrices in floats: what those lose is not worth a word.
constexpr double kSimilarityTolerance = 1e-5;

FittedWorkspace refused(const char* why, std::string values) {
  FittedWorkspace result;
  result.refusal = why;
  result.values = std::move(values);
  return result;
}

FittedWorkspace fitView(const Affine& T_view_world, const Box& view, const Box& device_m, WorkspaceFit fit) {
  FittedWorkspace result;
  const Vec3 ratio = view.extents().cwiseQuotient(device_m.extents());
  const double scale =
      fit == WorkspaceFit::published ? (std::max(ratio.x(), ratio.y()) + ratio.z()) / 2 : ratio.maxCoeff();
  if (!(scale > 1e-12 && scale < 1e12)) {
    return refused("the view has no extent", textOf(" extent ", view.extents().transpose()));
  }
  Affine T_view_device = Affine(Eigen::UniformScaling<double>(scale));
  T_view_device.translation() = view.centre() - scale * device_m.centre();

  Affine T_view_similar = T_view_world;
  const Mat3 similar = nearestSimilarity(T_view_world.linear());
  if (!((similar - T_view_world.linear()).norm() <= kSimilarityTolerance * similar.norm())) {
    result.warning =
        "the model matrix is not a rotation with one scale; the nearest such matrix is used, send one "
        "without "
        "shear, mirror or uneven scale";
    T_view_similar.linear() = similar;
  }
  if (!isInvertible(T_view_similar)) {
    return refused("the model matrix is singular",
                   textOf(" determinant ", T_view_similar.linear().determinant()));
  }
  const Affine T_world_device = T_view_similar.inverse() * T_view_device;
  if (!isInvertible(T_world_device))
    return refused("the map would not be a number", textOf(" scale ", scale));
  result.T_world_device = T_world_device;
  return result;
}

Vec3 corner(int i, const Vec3& min, const Vec3& max) {
  return {(i & 1) != 0 ? max.x() : min.x(), (i & 2) != 0 ? max.y() : min.y(),
          (i & 4) != 0 ? max.z() : min.z()};
}

FittedWorkspace badModel(const std::string& flaw) {
  return refused("the model matrix is not finite, singular, or not affine", " model matrix: " + flaw);
}

}  // namespace

FittedWorkspace fitProjection(const std::array<double, 16>& model, const std::array<double, 16>& projection,
                              const Box& device_m, WorkspaceFit fit) {
  std::string flaw;
  const std::optional<Affine> T_view_world = affineFrom(fromColumns(model), flaw);
  if (!T_view_world) return badModel(flaw);
  const Mat4 T_clip_view = fromColumns(projection);
  const Eigen::FullPivLU<Mat4> lu(T_clip_view);
  if (!T_clip_view.allFinite() || !lu.isInvertible()) {
    return refused("the projection matrix is not finite or singular",
                   T_clip_view.allFinite() ? textOf(" determinant ", T_clip_view.determinant())
                                           : " projection matrix: " + unusableNumberOf(T_clip_view));
  }
  const Mat4 T_view_clip = lu.inverse();
  Box view;
  for (int i = 0; i < 8; ++i) {
    const Vec3 clip = corner(i, Vec3::Constant(-1), Vec3::Constant(1));
    const Eigen::Vector4d p = T_view_clip * clip.homogeneous();
    if (!(std::abs(p.w()) >= 1e-12) || !p.allFinite()) {
      return refused("the projection matrix puts a corner of the view at infinity",
                     textOf(" corner ", clip.transpose()));
    }
    view.extend(Vec3(p.hnormalized()));
  }
  return fitView(*T_view_world, view, device_m, fit);
}

FittedWorkspace fitBox(const std::array<double, 16>& model, const std::array<double, 6>& box,
                       const Box& device_m, WorkspaceFit fit) {
  std::string flaw;
  const std::optional<Affine> T_view_world = affineFrom(fromColumns(model), flaw);
  if (!T_view_world) return badModel(flaw);
  const Vec3 min(box[0], box[1], box[2]);
  const Vec3 max(box[3], box[4], box[5]);
  if (!min.allFinite() || !max.allFinite()) {
    return refused("the box is not finite", textOf(" from ", min.transpose(), " to ", max.transpose()));
  }
  Box view;
  for (int i = 0; i < 8; ++i) view.extend(Vec3(*T_view_world * corner(i, min, max)));
  return fitView(*T_view_world, view, device_m, fit);
}

Workspace workspaceFrom(const Affine& T_world_device) {
  Workspace w;
  w.T_world_device = T_world_device;
  w.T_device_world = T_world_device.inverse();
  w.worldUnitsPerMetre = geometry::scaleOf(T_world_device.linear());
  return w;
}

}  // namespace hapticd::scene
