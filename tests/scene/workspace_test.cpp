// The map between device and world, and surfaces.
#include <gmock/gmock.h>

#include "scene/workspace_fit.h"
#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using geometry::Box;
using geometry::Mat3;
using geometry::Mat4;
using ::testing::HasSubstr;
using Severity = Notice::Severity;

// The workspace of the published OpenHaptics server, 160 x 160 x 90 mm.
const Box kPaper{Vec3(-0.080, -0.080, -0.070), Vec3(0.080, 0.080, 0.020)};
const std::array<double, 16> kIdentity = columns(Affine(Affine::Identity()));

Mat4 orthographic(const Vec3& min, const Vec3& max) {
  Mat4 m = Mat4::Identity();
  for (int i = 0; i < 3; ++i) {
    m(i, i) = 2 / (max[i] - min[i]);
    m(i, 3) = -(max[i] + min[i]) / (max[i] - min[i]);
  }
  m.row(2) *= -1;  // clip space is left-handed
  return m;
}

double scaleOf(const FittedWorkspace& w) {
  return std::cbrt(w.T_world_device->linear().determinant());
}

TEST(WorkspaceFit, PublishedFitOfAFlatBoxDoesNotEncloseIt) {
  const auto fitted = fitBox(kIdentity, {-50, -50, -5, 50, 50, 5}, kPaper, WorkspaceFit::published);
  ASSERT_TRUE(fitted.T_world_device);
  EXPECT_NEAR(scaleOf(fitted) / 1000, 0.36805555, 1e-8);  // world units per millimetre
  EXPECT_NEAR(160 * scaleOf(fitted) / 1000, 58.9, 0.05);
  EXPECT_TRUE((*fitted.T_world_device * kPaper.centre()).isZero(1e-9)) << "centre on centre";
  EXPECT_TRUE(fitted.warning.empty());
}

TEST(WorkspaceFit, EncloseReachesEverything) {
  const auto fitted = fitBox(kIdentity, {-50, -50, -5, 50, 50, 5}, kPaper, WorkspaceFit::enclose);
  EXPECT_NEAR(scaleOf(fitted) / 1000, 100.0 / 160, 1e-12);
  const Affine T_device_world = fitted.T_world_device->inverse();
  for (const Vec3& p : {Vec3(50, 50, 5), Vec3(-50, -50, -5)}) {
    const Vec3 q = T_device_world * p;
    EXPECT_TRUE((q.array() <= kPaper.max.array() + 1e-12).all() &&
                (q.array() >= kPaper.min.array() - 1e-12).all());
  }
}

TEST(WorkspaceFit, ProjectionFormIsTheBoxFormOfItsViewVolume) {
  const Vec3 min(-30, -10, -200);
  const Vec3 max(70, 50, -20);
  Affine model = at(3, 4, 5);
  model.linear() = 2 * Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const auto projected =
      fitProjection(columns(model), columns(orthographic(min, max)), kPaper, WorkspaceFit::published);
  ASSERT_TRUE(projected.T_world_device);
  const double s = (100 / 0.16 + 180 / 0.09) / 2;
  EXPECT_NEAR(scaleOf(projected), s / 2, 1e-6) << "the model's scale divides";
  // View volume's centre, back through the model, is where the workspace's centre goes.
  EXPECT_TRUE(
      (*projected.T_world_device * kPaper.centre()).isApprox(model.inverse() * Vec3(20, 20, -110), 1e-9));
  // A step along the device's x is a step along the view's x.
  const Vec3 step = projected.T_world_device->linear() * Vec3::UnitX();
  EXPECT_TRUE(step.isApprox(model.linear().inverse() * Vec3(s, 0, 0), 1e-9));
}

TEST(WorkspaceFit, PerspectiveUsesTheBoxOfItsFrustum) {
  // 90 degrees, near 1, far 3: x and y reach 3 at the far end, z from -3 to -1.
  Mat4 m = Mat4::Zero();
  m(0, 0) = m(1, 1) = 1;
  m(2, 2) = -2;
  m(2, 3) = -3;
  m(3, 2) = -1;
  const auto fitted = fitProjection(kIdentity, columns(m), kPaper, WorkspaceFit::published);
  ASSERT_TRUE(fitted.T_world_device);
  EXPECT_NEAR(scaleOf(fitted), (6 / 0.16 + 2 / 0.09) / 2, 1e-9);
  EXPECT_TRUE((*fitted.T_world_device * kPaper.centre()).isApprox(Vec3(0, 0, -2), 1e-12));
}

TEST(WorkspaceFit, BoxFormTakesTheBoxSeenThroughTheModel) {
  Affine model = Affine::Identity();
  model.linear() = Eigen::AngleAxisd(EIGEN_PI / 4, Vec3::UnitZ()).toRotationMatrix();
  const auto fitted = fitBox(columns(model), {-1, -1, -1, 1, 1, 1}, kPaper, WorkspaceFit::enclose);
  EXPECT_NEAR(scaleOf(fitted), std::max(2 * std::sqrt(2.0) / 0.16, 2 / 0.09), 1e-9);
}

TEST(WorkspaceFit, ModelThatIsNoSimilarityIsReplacedByTheNearest) {
  const struct {
    Mat3 model;
    double scale;  // of the nearest similarity
  } cases[] = {{Vec3(1, 2, 3).asDiagonal(), 2}, {Vec3(1, 1, -0.25).asDiagonal(), (2 - 0.25) / 3}};
  for (const auto& c : cases) {
    Affine model = Affine::Identity();
    model.linear() = c.model;
    const auto fitted = fitBox(columns(model), {-1, -1, -1, 1, 1, 1}, kPaper, WorkspaceFit::enclose);
    ASSERT_TRUE(fitted.T_world_device);
    EXPECT_THAT(fitted.warning, HasSubstr("not a rotation with one scale"));
    const Mat3 m = fitted.T_world_device->linear();
    const double s = scaleOf(fitted);
    EXPECT_TRUE((m.transpose() * m).isApprox(s * s * Mat3::Identity(), 1e-12));
    EXPECT_GT(m.determinant(), 0);
    const Vec3 extents = (c.model.cwiseAbs() * Vec3::Constant(2)).cwiseQuotient(kPaper.extents());
    EXPECT_NEAR(s, extents.maxCoeff() / c.scale, 1e-9);
  }
}

TEST(WorkspaceFit, RoundingOfFloatMatricesIsNotWorthAWarning) {
  Affine model = Affine::Identity();
  model.linear() = (3.7F * Eigen::AngleAxisf(1.1F, Eigen::Vector3f(1, 2, 3).normalized()).toRotationMatrix())
                       .cast<double>();
  EXPECT_EQ(fitBox(columns(model), {-1, -1, -1, 1, 1, 1}, kPaper, WorkspaceFit::published).warning, "");
}

TEST(WorkspaceFit, CornerAtInfinityIsRefused) {
  Mat4 m = Mat4::Identity();
  m.row(3) = Eigen::RowVector4d(0, 0, 1, 1);  // the inverse puts z = 1 at w = 0
  const auto fitted = fitProjection(kIdentity, columns(Mat4(m.inverse())), kPaper, WorkspaceFit::published);
  const Mat4 bad = [] {
    Mat4 inverse = Mat4::Identity();
    inverse.row(3) = Eigen::RowVector4d(0, 0, -1, 1);
    return Mat4(inverse.inverse());
  }();
  EXPECT_FALSE(fitProjection(kIdentity, columns(bad), kPaper, WorkspaceFit::published).T_world_device);
  EXPECT_FALSE(fitted.T_world_device);
  EXPECT_THAT(fitted.refusal, HasSubstr("at infinity"));
}

class WorkspaceOfScene : public SceneTest {
 protected:
  static SceneConfig paper() {
    SceneConfig config;
    config.deviceWorkspace_m = kPaper;
    return config;
  }
  WorkspaceOfScene() : SceneTest(paper()) {}
};

TEST_F(WorkspaceOfScene, EachCallReplacesTheMap) {
  for (int i = 0; i < 3; ++i) {
    say(SetWorkspaceBox{kIdentity, {-50, -50, -5, 50, 50, 5}});
    ASSERT_TRUE(publish());
    EXPECT_NEAR(scene_->workspace.worldUnitsPerMetre, 368.05555, 1e-4);
    EXPECT_TRUE((scene_->workspace.T_device_world * scene_->workspace.T_world_device)
                    .isApprox(Affine(Affine::Identity()), 1e-12));
  }
  say(SetWorkspaceProjection{kIdentity, columns(orthographic(Vec3(-8, -8, -4.5), Vec3(8, 8, 4.5)))});
  publish();
  EXPECT_NEAR(scene_->workspace.worldUnitsPerMetre, 100, 1e-9);
}

TEST_F(WorkspaceOfScene, HapticOriginAndScalePlaceTheDeviceInMetres) {
  say(SetHapticScale{2});
  say(SetHapticOrigin{Vec3(0.1, 0, 0), Vec3::UnitZ(), EIGEN_PI / 2});
  publish();
  EXPECT_NEAR(scene_->workspace.worldUnitsPerMetre, 2000, 1e-9);
  EXPECT_TRUE((scene_->workspace.T_world_device * Vec3(0.01, 0, 0)).isApprox(Vec3(100, 20, 0), 1e-9));
  say(SetWorkspaceBox{kIdentity, {-50, -50, -5, 50, 50, 5}});
  publish();
  EXPECT_NEAR(scene_->workspace.worldUnitsPerMetre, 368.05555, 1e-4) << "replaced";
}

TEST_F(WorkspaceOfScene, WarnsOfAnUnevenModel) {
  Affine model = Affine::Identity();
  model.linear() = Vec3(1, 2, 3).asDiagonal();
  say(SetWorkspaceBox{columns(model), {-1, -1, -1, 1, 1, 1}});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("setWorkspaceBoundingBox"));
  EXPECT_TRUE(publish());
}

class Surfaces : public SceneTest {
 protected:
  explicit Surfaces(SceneConfig config = {}) : SceneTest(std::move(config)) { makeTouchable(0); }
  void set(const char* name, double value) { say(SetSurfaceProperty{0, name, value}); }
  const Surface& surface() const { return object(0)->surface; }
};

TEST_F(Surfaces, ReferenceScale) {
  set("stiffness", 1);
  set("damping", 0.5);
  set("static friction", 0.8);
  set("dynamic friction", 0.3);
  set("popthrough", 0.5);
  set("mass", 2.5);
  publish();
  EXPECT_DOUBLE_EQ(surface().stiffness_N_per_m, 500);
  EXPECT_DOUBLE_EQ(surface().damping_Ns_per_m, 1);
  EXPECT_DOUBLE_EQ(surface().staticFriction, 0.8);
  EXPECT_DOUBLE_EQ(surface().dynamicFriction, 0.3);
  EXPECT_DOUBLE_EQ(surface().popthrough_N, 1.65);
  EXPECT_DOUBLE_EQ(surface().mass_kg, 2.5);
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Surfaces, OutOfRangeIsClampedAndUnknownNamesAreNamed) {
  set("stiffness", 1.5);
  EXPECT_EQ(onlyNotice(Severity::warning),
            "setHapticProperty object 0, stiffness 1.5 becomes 1: out of range, clamped");
  set("damping", -0.25);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("damping -0.25 becomes 0"));
  set("Stiffness", 0.5);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("'Stiffness'"));
  publish();
  EXPECT_DOUBLE_EQ(surface().stiffness_N_per_m, 500);
  EXPECT_DOUBLE_EQ(surface().damping_Ns_per_m, 0);
}

TEST_F(Surfaces, DynamicFrictionIsAtMostTheStaticOneWhateverComesFirst) {
  set("dynamic friction", 0.3);
  publish();
  EXPECT_DOUBLE_EQ(surface().dynamicFriction, 0);
  EXPECT_TRUE(notices_.empty()) << "the static one has not come yet";
  set("static friction", 0.5);
  publish();
  EXPECT_DOUBLE_EQ(surface().dynamicFriction, 0.3);
  EXPECT_TRUE(notices_.empty());
  set("static friction", 0.2);
  publish();
  EXPECT_DOUBLE_EQ(surface().dynamicFriction, 0.2);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("dynamic friction 0.3 is above static friction 0.2"));
}

TEST_F(Surfaces, AStaticFrictionOfZeroTellsThatItLowersTheDynamicOne) {
  set("dynamic friction", 0.3);
  set("static friction", 0);
  publish();
  EXPECT_DOUBLE_EQ(surface().dynamicFriction, 0);
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("dynamic friction 0.3 is above static friction 0"));
}

TEST_F(Surfaces, StockUnitsAreTheSameOnEveryDeviceAndAreClamped) {
  say(SetSurface{0, 2, 0.001, 0.5, 0.4});
  EXPECT_EQ(
      onlyNotice(Severity::warning),
      "updateTrimeshChanges object 0, stiffness 2 is not within 0 to 1, 1 is used: out of range, clamped");
  publish();
  EXPECT_DOUBLE_EQ(surface().stiffness_N_per_m, 1000);
  EXPECT_DOUBLE_EQ(surface().damping_Ns_per_m, 1);
}

TEST_F(Surfaces, DampingKeepsWithinThePassivityBound) {
  say(SetSurface{0, 1, 0.005, 0, 0});  // 1000 N/m and 5 N s/m on a device with 5 N s/m of its own
  publish();
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("unstable on this device"));
  EXPECT_DOUBLE_EQ(surface().stiffness_N_per_m, 1000);
  EXPECT_LT(surface().stiffness_N_per_m * 0.0005 + surface().damping_Ns_per_m, 5);
  EXPECT_GT(surface().damping_Ns_per_m, 4.4);
  say(SetTransform{0, columns(at(1, 0, 0))});
  say(SetSurface{0, 1, 0.005, 0.1, 0.1});
  publish();
  EXPECT_TRUE(notices_.empty()) << "said once";
}

TEST_F(Surfaces, ManyDifferentRemarksAreCountedToo) {
  for (int i = 0; i < 100; ++i) {
    say(SetSurface{0, 1, 0.0047 + i * 1e-6, 0, 0});
    publish();
  }
  EXPECT_EQ(notices_.size(), 8U);
}

class SurfacesOnASlowLink : public Surfaces {
 protected:
  static SceneConfig slow() {
    SceneConfig config;
    config.materialScale = MaterialScale::device;
    config.nominalStiffness_N_per_m = 2000;
    config.nominalForce_N = 8;
    config.ownDamping_Ns_per_m = 2.5;
    config.transportDelay_s = 0.0015;
    return config;
  }
  SurfacesOnASlowLink() : Surfaces(slow()) {}
};

TEST_F(SurfacesOnASlowLink, DeviceScaleAndDelayCount) {
  set("popthrough", 0.5);
  set("stiffness", 1);
  set("damping", 0.5);
  publish();
  EXPECT_DOUBLE_EQ(surface().popthrough_N, 4);
  EXPECT_NEAR(surface().stiffness_N_per_m, 1250, 2) << "2.5 / 2 ms";
  EXPECT_NEAR(surface().damping_Ns_per_m, 0, 1e-9);
}

class RawSurfaces : public Surfaces {
 protected:
  static SceneConfig raw() {
    SceneConfig config;
    config.raw = true;
    return config;
  }
  RawSurfaces() : Surfaces(raw()) {}
};

TEST_F(RawSurfaces, HaveNoLimitsButStayNumbers) {
  set("stiffness", 100);
  set("damping", 50);
  set("static friction", 2);
  publish();
  EXPECT_DOUBLE_EQ(surface().stiffness_N_per_m, 50'000);
  EXPECT_DOUBLE_EQ(surface().damping_Ns_per_m, 100);
  EXPECT_DOUBLE_EQ(surface().staticFriction, 2);
  EXPECT_TRUE(notices_.empty());
  say(SetSurface{0, 1, INFINITY, 0, 0});
  publish();
  EXPECT_DOUBLE_EQ(surface().stiffness_N_per_m, 50'000);
  say(SetSurface{0, -1, 0, 0, 0});
  publish();
  EXPECT_EQ(object(0), nullptr) << "no stiffness";
}

}  // namespace
}  // namespace hapticd::scene
