#include "server/station/scripted_hand.h"

#include <gtest/gtest.h>

#include "scene/builder.h"

namespace hapticd::server {
namespace {

using geometry::Vec3;

// A box of 40 mm around the origin, as sent by a client whose world unit is a millimetre.
std::shared_ptr<const scene::SceneSnapshot> boxScene() {
  scene::SceneBuilder builder;
  std::vector<scene::Notice> notices;
  scene::SetVertices run{0, 0, {}};
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-20.0F, 20.0F}) {
      const auto corner = [&](float u, float v) {
        geometry::Vec3f p;
        p[axis] = side;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        return p;
      };
      for (const auto& p : {corner(-20, -20), corner(20, -20), corner(20, 20), corner(-20, -20),
                            corner(20, 20), corner(-20, 20)}) {
        run.positions.push_back(p);
      }
    }
  }
  builder.apply(1, scene::BeginBatch{}, 0, notices);
  builder.apply(1, std::move(run), 0, notices);
  builder.apply(1, scene::SetSurfaceProperty{0, "stiffness", 1.0}, 0, notices);
  builder.apply(1, scene::CommitBatch{}, 0, notices);
  return builder.publish(0, notices);
}

const geometry::Box kWorkspace{Vec3(-0.08, -0.06, -0.035), Vec3(0.08, 0.06, 0.035)};

TEST(ScriptedHand, EmptySceneGivesAClosedCircleInTheWorkspace) {
  const auto path = planStrokes(scene::SceneSnapshot{}, kWorkspace, 0);
  ASSERT_GT(path.size(), 8U);
  EXPECT_LT((path.front().position_m - path.back().position_m).norm(), 1e-9);
  for (const auto& point : path) {
    EXPECT_TRUE((point.position_m.array() >= kWorkspace.min.array()).all());
    EXPECT_TRUE((point.position_m.array() <= kWorkspace.max.array()).all());
  }
}

TEST(ScriptedHand, StrokesDipIntoTheSurfaceAndTimesIncrease) {
  const auto path = planStrokes(*boxScene(), kWorkspace, 0);
  int inside = 0;
  bool pressed = false;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vec3& p = path[i].position_m;
    const double depth = 0.020 - p.cwiseAbs().maxCoeff();
    EXPECT_LT(depth, 0.0045) << "deeper than a press";
    inside += depth > 0.003 ? 1 : 0;
    pressed = pressed || path[i].buttons != 0;
    if (i > 0) {
      EXPECT_GT(path[i].time_s, path[i - 1].time_s);
    }
  }
  EXPECT_GT(inside, 40);
  EXPECT_TRUE(pressed);
  EXPECT_LT((path.front().position_m - path.back().position_m).norm(), 1e-9);
  EXPECT_NO_THROW(device::WaypointPath(path, device::WaypointPath::Repeat::yes));
}

TEST(ScriptedHand, TheSameSceneGivesTheSamePath) {
  const auto scene = boxScene();
  const auto a = planStrokes(*scene, kWorkspace, 0);
  const auto b = planStrokes(*scene, kWorkspace, 0);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].position_m, b[i].position_m);
}

}  // namespace
}  // namespace hapticd::server
