#include "geometry/triangle_crossing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <random>

namespace hapticd::geometry {
namespace {

using Int = boost::multiprecision::int512_t;
using IntVec = std::array<Int, 3>;
using IntTriangle = std::array<IntVec, 3>;

// Coordinates as integer multiples of 2^-exponent.
IntVec whole(const Vec3f& v, int exponent) {
  IntVec out;
  for (int i = 0; i < 3; ++i) out[i] = Int(std::ldexp(static_cast<double>(v[i]), exponent));
  return out;
}

IntTriangle whole(const Corners3f& t, int exponent) {
  return {whole(t[0], exponent), whole(t[1], exponent), whole(t[2], exponent)};
}

IntVec minus(const IntVec& a, const IntVec& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Int dot(const IntVec& a, const IntVec& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
IntVec crossed(const IntVec& a, const IntVec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
bool isZero(const IntVec& a) {
  return a[0] == 0 && a[1] == 0 && a[2] == 0;
}

int orientationOf(const IntVec& a, const IntVec& b, const IntVec& c, const IntVec& d) {
  return dot(crossed(minus(a, d), minus(b, d)), minus(c, d)).sign();
}

// A plane separates the interiors: no corner of one lies beyond a corner of the other, and not all are
// coplanar.
bool separates(const IntVec& normal, const IntTriangle& a, const IntTriangle& b) {
  if (isZero(normal)) return false;
  std::array<Int, 3> along;
  std::array<Int, 3> other;
  for (int i = 0; i < 3; ++i) {
    along[i] = dot(normal, a[i]);
    other[i] = dot(normal, b[i]);
  }
  const auto [lowA, highA] = std::minmax_element(along.begin(), along.end());
  const auto [lowB, highB] = std::minmax_element(other.begin(), other.end());
  if (*lowA == *highA && *lowB == *highB && *lowA == *lowB) return false;
  return *highA <= *lowB || *highB <= *lowA;
}

// An independent answer in integers: two convex sets share no inner point if and only if a plane separates
// them. For two triangles it suffices to try planes of a face, planes along an edge of each, and planes
// normal to a common plane.
bool crossByPlanes(const IntTriangle& a, const IntTriangle& b) {
  const auto edges = [](const IntTriangle& t) {
    return std::array{minus(t[1], t[0]), minus(t[2], t[1]), minus(t[0], t[2])};
  };
  const auto edgesA = edges(a);
  const auto edgesB = edges(b);
  const IntVec normalA = crossed(edgesA[0], edgesA[1]);
  const IntVec normalB = crossed(edgesB[0], edgesB[1]);
  if (isZero(normalA) || isZero(normalB)) return false;
  std::vector<IntVec> normals{normalA, normalB};
  for (const IntVec& u : edgesA) {
    for (const IntVec& v : edgesB) normals.push_back(crossed(u, v));
    normals.push_back(crossed(normalA, u));
  }
  for (const IntVec& v : edgesB) normals.push_back(crossed(normalB, v));
  return std::none_of(normals.begin(), normals.end(),
                      [&](const IntVec& normal) { return separates(normal, a, b); });
}

bool crosses(const Corners3f& a, const Corners3f& b) {
  ExactCount exact = 0;
  return cross(a, b, exact);
}

Corners3f onLattice(std::mt19937& random, int size) {
  std::uniform_int_distribution<int> coordinate(-size, size);
  Corners3f t;
  for (Vec3f& v : t) {
    for (int i = 0; i < 3; ++i) v[i] = static_cast<float>(coordinate(random));
  }
  return t;
}

TEST(Orientation, TellsHowEveryFloatLies) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> coordinate(-1, 1);
  std::uniform_int_distribution<int> scale(-20, 20);
  ExactCount exact = 0;
  for (int round = 0; round < 2'000; ++round) {
    const auto number = [&] { return std::ldexp(coordinate(random), scale(random)); };
    std::array<Vec3f, 4> points;
    for (Vec3f& p : points) p = Vec3f(number(), number(), number());
    const auto& [a, b, c, d] = points;
    constexpr int kExponent = 75;  // below the last bit of 2^-20 times a float
    const int expected =
        orientationOf(whole(a, kExponent), whole(b, kExponent), whole(c, kExponent), whole(d, kExponent));
    EXPECT_EQ(orientation(a, b, c, d, exact), expected) << "round " << round;
    EXPECT_EQ(orientation(b, a, c, d, exact), -expected) << "round " << round;
    EXPECT_EQ(orientation(a, b, c, b, exact), 0) << "round " << round;
  }
  EXPECT_LT(exact, 10U) << "the slow way is the exception";
}

// Coplanar points, and an offset from their plane that double arithmetic loses beside the other terms.
TEST(Orientation, IsExactWhereRoundingWouldDecide) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> coordinate(-1'000, 1'000);
  std::uniform_int_distribution<int> factor(-9, 9);
  std::array<int, 3> seen{};
  ExactCount exact = 0;
  for (int round = 0; round < 3'000; ++round) {
    const auto whole3 = [&] { return Vec3(coordinate(random), coordinate(random), coordinate(random)); };
    const Vec3 u = whole3();
    const Vec3 v = whole3();
    Vec3 in = whole3();
    const int k = round % 3;
    in[k] = 0;
    const Vec3 base = in - factor(random) * u - factor(random) * v;
    const Vec3f a = base.cast<float>();
    const Vec3f b = (base + u).cast<float>();
    const Vec3f c = (base + v).cast<float>();
    Vec3f d = in.cast<float>();
    d[k] = static_cast<float>(round % 9 / 3 - 1) * std::ldexp(1.0F, -100);
    const int expected = orientationOf(whole(a, 100), whole(b, 100), whole(c, 100), whole(d, 100));
    EXPECT_EQ(orientation(a, b, c, d, exact), expected) << "round " << round;
    EXPECT_EQ(orientation(d, c, b, a, exact), expected) << "round " << round;
    EXPECT_EQ(orientation(b, a, c, d, exact), -expected) << "round " << round;
    ++seen[static_cast<std::size_t>(expected + 1)];
  }
  EXPECT_GT(exact, 1'000U);
  for (const int count : seen) EXPECT_GT(count, 500);
}

TEST(Orientation, HoldsForTheLargestAndTheSmallestFloats) {
  ExactCount exact = 0;
  for (const float s : {std::numeric_limits<float>::max(), std::numeric_limits<float>::denorm_min()}) {
    const Vec3f a(s, 0, 0);
    const Vec3f b(0, s, 0);
    const Vec3f c(0, 0, s);
    EXPECT_EQ(orientation(a, b, c, Vec3f::Zero(), exact), 1);
    EXPECT_EQ(orientation(a, b, c, Vec3f(s, s, s), exact), -1);
    EXPECT_EQ(orientation(a, b, c, Vec3f(-s, s, s), exact), 0);
    EXPECT_EQ(orientationAlong(2, a, b, Vec3f::Zero(), exact), 1);
    EXPECT_EQ(orientationAlong(0, b, c, Vec3f::Zero(), exact), 1);
    EXPECT_EQ(orientationAlong(1, c, a, Vec3f::Zero(), exact), 1);
  }
}

TEST(TriangleCrossing, AgreesWithSeparatingPlanesInWholeNumbers) {
  std::mt19937 random(2);
  // Small lattices produce every special case: common corners, edges in faces, coplanar triangles, no area.
  int crossing = 0;
  int apart = 0;
  for (const int size : {1, 2, 3, 8, 1'000'000}) {
    for (int round = 0; round < 6'000; ++round) {
      Corners3f a = onLattice(random, size);
      const Corners3f b = onLattice(random, size);
      if (round % 4 == 0) a[round % 3] = b[0];
      if (round % 8 == 0) a[(round + 1) % 3] = b[1];
      const bool expected = crossByPlanes(whole(a, 0), whole(b, 0));
      (expected ? crossing : apart) += 1;
      ASSERT_EQ(crosses(a, b), expected)
          << a[0].transpose() << ", " << a[1].transpose() << ", " << a[2].transpose() << " and "
          << b[0].transpose() << ", " << b[1].transpose() << ", " << b[2].transpose();
      ASSERT_EQ(crosses(b, a), expected);
      ASSERT_EQ(crosses({a[2], a[1], a[0]}, {b[1], b[2], b[0]}), expected);
    }
  }
  EXPECT_GT(crossing, 1'000);
  EXPECT_GT(apart, 1'000);
}

TEST(TriangleCrossing, InOnePlaneAgreesToo) {
  std::mt19937 random(3);
  int crossing = 0;
  for (int round = 0; round < 10'000; ++round) {
    Corners3f a = onLattice(random, 4);
    Corners3f b = onLattice(random, 4);
    // The plane x + 2y - z = 3, which no axis looks along.
    for (Corners3f* t : {&a, &b}) {
      for (Vec3f& v : *t) v.z() = v.x() + 2 * v.y() - 3;
    }
    const bool expected = crossByPlanes(whole(a, 0), whole(b, 0));
    ASSERT_EQ(crosses(a, b), expected) << "round " << round;
    crossing += expected ? 1 : 0;
  }
  EXPECT_GT(crossing, 1'000);
}

TEST(TriangleCrossing, NeighboursTouchButDoNotCross) {
  const Vec3f o(0, 0, 0);
  const Vec3f x(1, 0, 0);
  const Vec3f y(0, 1, 0);
  const Vec3f z(0, 0, 1);
  EXPECT_FALSE(crosses({o, x, y}, {x, o, z})) << "one edge";
  EXPECT_FALSE(crosses({o, x, y}, {o, Vec3f(-1, 0, 0), z})) << "one corner";
  EXPECT_FALSE(crosses({o, x, y}, {y, x, Vec3f(1, 1, 0)})) << "one edge, in one plane";
  EXPECT_TRUE(crosses({o, x, y}, {x, o, Vec3f(0.3F, 0.5F, 0)})) << "one edge, folded back onto each other";
  EXPECT_TRUE(crosses({o, x, y}, {o, Vec3f(1, 1, 1), Vec3f(1, 1, -1)})) << "one corner, and through";
  EXPECT_FALSE(crosses({o, x, y}, {Vec3f(0.2F, 0.2F, 0), z, Vec3f(1, 0, 1)})) << "a corner on the face";
  EXPECT_FALSE(crosses({o, x, y}, {Vec3f(0.1F, 0.1F, 0), Vec3f(0.4F, 0.2F, 0), z})) << "an edge on the face";
  EXPECT_TRUE(crosses({o, x, y}, {Vec3f(0.2F, 0.2F, -1e-30F), z, Vec3f(1, 0, 1)})) << "a hair deeper";
  EXPECT_FALSE(crosses({o, x, x}, {Vec3f(0.5F, -1, -1), Vec3f(0.5F, 1, -1), Vec3f(0.5F, 0, 1)})) << "no area";
}

}  // namespace
}  // namespace hapticd::geometry
