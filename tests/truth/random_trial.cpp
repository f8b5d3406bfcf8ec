#include "truth/random_trial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "truth/meshes.h"

namespace hapticd::truth {
namespace {

constexpr std::array kKinds{"soup",   "junctions", "pocket", "groove", "needles",   "fan",
                            "sheets", "nested",    "bumps",  "moving", "deforming", "large"};
constexpr double kHalf_m = 0.02;  // of most scenes

// A scene in its own frame, near the origin; place() turns it into a trial.
class Maker {
 public:
  Maker(std::uint64_t seed, const std::string& kind) : dice_(seed) {
    trial_.seed = seed;
    trial_.kind = kind.empty() ? kKinds[static_cast<std::size_t>(pickKind())] : kind;
  }

  Trial make() {
    makeShapes();
    makeTool();
    place();
    makeMaterials();
    makePlanes();
    makeHand();
    return std::move(trial_);
  }

 private:
  int pickKind() {
    const auto last = static_cast<int>(kKinds.size()) - 1;
    // Large scenes take long to build.
    const int k = dice_.integer(0, last);
    return k == last && dice_.chance(0.8) ? dice_.integer(0, last - 1) : k;
  }

  void makeShapes() {
    const std::string& kind = trial_.kind;
    if (kind == "soup") makeSoup();
    if (kind == "junctions") makeJunctions();
    if (kind == "pocket") makePocket();
    if (kind == "groove") makeGroove();
    if (kind == "needles") makeNeedles();
    if (kind == "fan") makeFan();
    if (kind == "joined") makeJoinedFan();
    if (kind == "valleys") makeValleys();
    if (kind == "sheets") makeSheets();
    if (kind == "nested") makeNested();
    if (kind == "bumps")
      shapes_.push_back(bumps(dice_.integer(2, 9), kHalf_m, dice_.uniform(0, 0.006), 0.3, dice_));
    if (kind == "moving") makeMoving();
    if (kind == "deforming")
      shapes_.push_back(bumps(dice_.integer(2, 7), kHalf_m, dice_.uniform(0, 0.004), 0.3, dice_));
    if (kind == "large") makeLarge();
    if (shapes_.empty()) throw std::runtime_error("no scenes of the kind '" + kind + "'");
    const bool closed = kind == "pocket" || kind == "groove" || kind == "large";
    trial_.sides = closed && dice_.chance(0.5) ? Sides::front : static_cast<Sides>(dice_.integer(0, 3) % 3);
    if (dice_.chance(0.5)) trial_.sides = Sides::both;
    // A room with both sides touchable that appears around the hand is not felt until the hand has left it.
    if (enclosed_) trial_.sides = Sides::front;
    // Of mixed winding, no triangles are joined, and the work of a tick does not suffice for them.
    if (!enclosed_ && kind != "joined" && dice_.chance(0.15)) mixWinding();
  }

  void makeSoup() {
    const int objects = dice_.integer(1, 3);
    for (int i = 0; i < objects; ++i)
      shapes_.push_back(soup(dice_.integer(2, 40), 0.012, 0.001, 0.02, dice_));
  }

  // Two halves of a plate, of different cells and angles, that share no vertices.
  void makeJunctions() {
    const double bend = dice_.chance(0.3) ? 0.0 : dice_.uniform(-1.2, 1.2);
    const Point down(std::cos(bend), 0, std::sin(bend));
    Shape left = patch({-kHalf_m, -kHalf_m, 0}, {kHalf_m, 0, 0}, {0, 2 * kHalf_m, 0}, dice_.integer(1, 4),
                       dice_.integer(1, 7), 0.3, dice_);
    const Shape right = patch({smallGap(), -kHalf_m, 0}, kHalf_m * down, {0, 2 * kHalf_m, 0},
                              dice_.integer(1, 4), dice_.integer(1, 7), 0.3, dice_);
    if (dice_.chance(0.5)) {
      left.append(right);
      shapes_.push_back(left);
    } else {
      shapes_ = {left, right};
    }
  }

  double smallGap() { return dice_.chance(0.3) ? 0.0 : dice_.logarithmic(1e-12, 9e-6); }

  void makePocket() {
    half_ = Point(dice_.uniform(0.004, 0.02), dice_.uniform(0.004, 0.02), dice_.uniform(0.004, 0.02));
    shapes_.push_back(pocket(half_, 3, smallGap(), dice_));
    if (dice_.chance(0.5)) splitIntoObjects(dice_.integer(2, 6));
    enclosed_ = true;
  }

  void splitIntoObjects(int count) {
    const Shape all = shapes_[0];
    shapes_.assign(static_cast<std::size_t>(count), Shape{all.vertices, {}});
    for (const auto& t : all.triangles)
      shapes_[static_cast<std::size_t>(dice_.integer(0, count - 1))].triangles.push_back(t);
    std::erase_if(shapes_, [](const Shape& s) { return s.triangles.empty(); });
  }

  // Two walls that meet in a crease, each tessellated on its own.
  void makeGroove() {
    const double angle = dice_.uniform(0.15, 1.4);  // of each wall above the ground
    const double turn = dice_.uniform(-0.1, 0.1);
    const Point along(0, 2 * kHalf_m, 0);
    for (const double side : {-1.0, 1.0}) {
      const double up = angle + side * turn;
      const Point wall = 1.5 * kHalf_m * Point(side * std::cos(up), 0, std::sin(up));
      const Point origin(side * smallGap(), -kHalf_m, 0);
      shapes_.push_back(
          side > 0 ? patch(origin, wall, along, dice_.integer(1, 4), dice_.integer(1, 7), 0.3, dice_)
                   : patch(origin, along, wall, dice_.integer(1, 7), dice_.integer(1, 4), 0.3, dice_));
    }
    if (dice_.chance(0.4)) {
      shapes_[0].append(shapes_[1]);
      shapes_.pop_back();
    }
  }

  void makeNeedles() {
    shapes_.push_back(strips(dice_.integer(3, 60), kHalf_m, dice_));
    if (dice_.chance(0.5)) {
      Shape more = strips(dice_.integer(3, 30), kHalf_m, dice_);
      transform(more, dice_.rotation(), dice_.inCube(0.005));
      if (dice_.chance(0.5)) {
        shapes_[0].append(more);
      } else {
        shapes_.push_back(more);
      }
    }
  }

  void makeFan() {
    shapes_.push_back(fan(dice_.integer(3, 150), kHalf_m, dice_.uniform(-0.02, 0.02)));
    if (dice_.chance(0.3))
      shapes_.push_back(fan(dice_.integer(3, 40), 0.5 * kHalf_m, dice_.uniform(-0.02, 0.02)));
  }

  // So many triangles around one vertex that the renderer takes several as one (geometry/fans.h). Slow to
  // judge: only on request.
  void makeJoinedFan() {
    shapes_.push_back(fan(dice_.integer(256, 1200), kHalf_m, dice_.uniform(-0.02, 0.02)));
  }

  // Pits, ridges and narrow valleys, where three faces hold the proxy and one of them ends. Only on request,
  // so that seeds of the other kinds give the scenes that they always gave.
  void makeValleys() {
    if (dice_.chance(0.5)) {
      shapes_.push_back(sphere(dice_.integer(2, 5), 0.014, dice_.uniform(0.2, 0.6), dice_));
      return;
    }
    const int cells = dice_.integer(3, 9);
    const double relief = dice_.uniform(0.2, 2) * kHalf_m / cells;
    Shape ground = bumps(cells, kHalf_m, 0, 0.35, dice_);
    for (Point& p : ground.vertices) p.z() += dice_.uniform(-relief, relief);
    shapes_.push_back(ground);
  }

  // Copies of one sheet, at most a little apart, and a sheet that crosses them.
  void makeSheets() {
    const Shape sheet = bumps(dice_.integer(1, 5), kHalf_m, dice_.uniform(0, 0.003), 0.3, dice_);
    for (int i = dice_.integer(2, 3); i > 0; --i) {
      Shape copy = sheet;
      const double apart = dice_.chance(0.4) ? 0.0 : dice_.logarithmic(1e-10, 1e-3);
      for (Point& p : copy.vertices) p += dice_.inCube(apart);
      if (dice_.chance(0.3)) {
        for (std::size_t k = 0; k < copy.triangles.size(); ++k) copy.flip(k);
      }
      shapes_.push_back(copy);
    }
    if (dice_.chance(0.5)) {
      Shape crossing = sheet;
      transform(crossing, dice_.rotation(), dice_.inCube(0.003));
      shapes_.push_back(crossing);
    }
  }

  void makeNested() {
    const double roughness = dice_.uniform(0, 0.2);
    shapes_.push_back(sphere(dice_.integer(1, 4), 0.012, roughness, dice_));
    shapes_.push_back(dice_.chance(0.5)
                          ? sphere(dice_.integer(1, 3), dice_.uniform(0.006, 0.0119), roughness, dice_)
                          : box(dice_.inCube(0.002), Point::Constant(dice_.uniform(0.002, 0.008))));
    if (dice_.chance(0.3)) shapes_.push_back(box(dice_.inCube(0.01), Point(0.03, 0.001, 0.004)));
  }

  void makeMoving() {
    for (int i = dice_.integer(1, 3); i > 0; --i) {
      Shape shape = dice_.chance(0.5) ? box(Point::Zero(), Point(0.008, 0.008, 0.002))
                                      : sphere(dice_.integer(1, 4), 0.008, 0.1, dice_);
      transform(shape, dice_.rotation(), dice_.inCube(0.008));
      shapes_.push_back(shape);
    }
  }

  void makeLarge() {
    if (dice_.chance(0.5)) {
      shapes_.push_back(sphere(dice_.integer(36, 60), 0.02, dice_.uniform(0, 0.02), dice_));
    } else {
      shapes_.push_back(bumps(dice_.integer(71, 110), kHalf_m, dice_.uniform(0, 0.004), 0.3, dice_));
    }
  }

  void mixWinding() {
    for (Shape& shape : shapes_) {
      for (std::size_t k = 0; k < shape.triangles.size(); ++k) {
        if (dice_.chance(0.5)) shape.flip(k);
      }
    }
  }

  void makeTool() {
    trial_.toolRadius_m = dice_.chance(0.7) ? 0.0 : dice_.logarithmic(0.5e-3, 5e-3);
    // A pocket has room for the ball.
    if (enclosed_) trial_.toolRadius_m = std::min(trial_.toolRadius_m, 0.4 * half_.minCoeff());
  }

  // Into the device frame, each object with a placement of its own.
  void place() {
    constexpr std::array kUnits{1000.0, 1.0, 39.37};
    trial_.worldUnitsPerMetre = kUnits[static_cast<std::size_t>(dice_.integer(0, 2))];
    rotation_ = dice_.rotation();
    offset_ = dice_.chance(0.25) ? Point(10 * dice_.direction()) : dice_.inCube(0.03);
    for (Shape shape : shapes_) {
      transform(shape, rotation_, offset_);
      Pose pose;
      pose.position_m = offset_ + dice_.inCube(0.02);
      if (dice_.chance(0.7)) pose.rotation = dice_.rotation();
      pose.scale = Point::Constant(dice_.chance(0.5) ? 0.001 : dice_.logarithmic(0.001, 10));
      if (dice_.chance(0.2))
        pose.scale = pose.scale.cwiseProduct(Point(1, dice_.uniform(0.3, 3), dice_.uniform(0.3, 3)));
      trial_.objects.push_back(bake(shape, pose));
    }
    if (enclosed_) {
      for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
          const Point normal = rotation_ * Point(sign * Point::Unit(axis));
          trial_.enclosure.push_back({normal, normal.dot(offset_) + half_[axis]});
        }
      }
    }
    if (trial_.kind == "moving") {
      for (TrialObject& object : trial_.objects) makePoses(object);
    }
    if (trial_.kind == "deforming") makeTarget(trial_.objects[0]);
  }

  // A stream of poses at 60 Hz, on a smooth random way.
  void makePoses(TrialObject& object) {
    if (dice_.chance(0.2)) return;
    const Point velocity = dice_.uniform(0, 0.15) * dice_.direction();
    const Point axis = dice_.direction();
    const double spin = dice_.chance(0.5) ? 0.0 : dice_.uniform(-3, 3);
    const double sway = dice_.uniform(1, 8);
    const Pose first = object.poses[0];
    const int poses = dice_.integer(4, 50);
    for (int k = 1; k < poses; ++k) {
      const double t = k * kPoseTicks * kPeriod_s;
      Pose pose = first;
      pose.position_m += std::sin(sway * t) / sway * velocity;
      pose.rotation =
          Eigen::Quaterniond(Eigen::AngleAxisd(std::sin(sway * t) / sway * spin, axis)) * first.rotation;
      object.poses.push_back(pose);
    }
  }

  void makeTarget(TrialObject& object) {
    object.target = object.vertices;
    const double metres = object.poses[0].scale.maxCoeff();
    for (Corner& v : object.target) v += (dice_.uniform(0, 0.002) / metres * dice_.direction()).cast<float>();
    object.morphBegin = dice_.integer(50, 300);
    object.morphEnd = object.morphBegin + dice_.integer(20, 300);
  }

  Material randomMaterial() {
    Material m;
    m.stiffness_N_per_m = equalStiffness_ > 0 ? equalStiffness_ : dice_.logarithmic(100, 4000);
    if (damped_) m.damping_Ns_per_m = dice_.uniform(0, 2);
    if (rough_) {
      m.staticFriction = dice_.uniform(0.05, 1.2);
      m.dynamicFriction = dice_.uniform(0, 1) * m.staticFriction;
    }
    return m;
  }

  void makeMaterials() {
    rough_ = dice_.chance(0.3);
    damped_ = dice_.chance(0.2);
    if (dice_.chance(0.6)) equalStiffness_ = dice_.logarithmic(100, 4000);
    for (TrialObject& object : trial_.objects) {
      object.material = randomMaterial();
      if (!enclosed_ && dice_.chance(0.05)) object.material.popthrough_N = dice_.uniform(0.5, 3);
    }
  }

  void makePlanes() {
    // In a corner with a plane, the spring does not tell the side of joined triangles that the proxy is on.
    if (enclosed_ || trial_.kind == "joined" || !dice_.chance(0.12)) return;
    for (int i = dice_.integer(1, 3); i > 0; --i) {
      TrialPlane plane;
      plane.normal = dice_.direction();
      plane.offset_m = dice_.uniform(0, 0.01) - plane.normal.dot(offset_);
      plane.material = randomMaterial();
      trial_.planes.push_back(plane);
    }
  }

  // A point of a random face in the frame of the scene, and the face's normal.
  std::pair<Point, Point> onSurface() {
    const Shape& shape =
        shapes_[static_cast<std::size_t>(dice_.integer(0, static_cast<int>(shapes_.size()) - 1))];
    const auto& t = shape.triangles[static_cast<std::size_t>(
        dice_.integer(0, static_cast<int>(shape.triangles.size()) - 1))];
    const Point& a = shape.vertices[t[0]];
    const Point e = shape.vertices[t[1]] - a;
    const Point f = shape.vertices[t[2]] - a;
    double u = dice_.uniform(0, 1);
    double v = dice_.chance(0.4) ? 0.0 : dice_.uniform(0, 1);  // often on an edge, sometimes on a corner
    if (v == 0 && dice_.chance(0.3)) u = 0;
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    return {a + u * e + v * f, e.cross(f).stableNormalized()};
  }

  void makeHand() {
    const int ticks = trial_.kind == "large" ? 800 : dice_.integer(300, 1500);
    hip_ = freeStart();
    addHip(hip_);
    while (static_cast<int>(trial_.hips.size()) < ticks) {
      switch (dice_.integer(0, 5)) {
        case 0:
          press();
          break;
        case 1:
          tremble();
          break;
        case 2:
          slide();
          break;
        case 3:
          circle();
          break;
        case 4:
          tap();
          break;
        default:
          stroke();
          break;
      }
    }
    trial_.hips.resize(static_cast<std::size_t>(ticks));
  }

  Point freeStart() {
    if (enclosed_) return dice_.inCube(0.3 * (half_.minCoeff() - trial_.toolRadius_m));
    Point start = 0.06 * dice_.direction();
    if (!trial_.planes.empty()) {
      for (int i = 0; i < 200; ++i) {
        const bool inFront =
            std::all_of(trial_.planes.begin(), trial_.planes.end(), [&](const TrialPlane& p) {
              return p.normal.dot(rotation_ * start + offset_) + p.offset_m > trial_.toolRadius_m + 1e-4;
            });
        if (inFront) return start;
        start = 0.06 * dice_.direction();
      }
      trial_.planes.clear();
    }
    return start;
  }

  void addHip(const Point& p) {
    hip_ = p;
    trial_.hips.push_back(rotation_ * p + offset_);
  }
  void move(const Point& to, double speed) {
    const Point from = hip_;
    const int ticks = std::clamp(static_cast<int>((to - from).norm() / (speed * kPeriod_s)), 1, 300);
    for (int i = 1; i <= ticks; ++i) addHip(from + (static_cast<double>(i) / ticks) * (to - from));
  }
  double speed() { return dice_.logarithmic(0.005, 0.5); }

  Point below() {
    const auto [point, normal] = onSurface();
    const double side = trial_.sides == Sides::back ? -1.0 : 1.0;
    // From the front by the normal, or along the way of the hand.
    const Point way = dice_.chance(0.5) ? Point(-side * normal) : Point((point - hip_).stableNormalized());
    return point + dice_.uniform(0, 0.004) * way;
  }
  void press() {
    move(below(), speed());
    if (dice_.chance(0.5)) tremble();
  }
  void tap() {
    const Point from = hip_;
    move(below(), dice_.logarithmic(0.1, 1));
    move(from, dice_.logarithmic(0.1, 1));
  }
  void stroke() { move(below() + dice_.inCube(0.01), dice_.logarithmic(0.2, 2)); }
  void slide() {
    for (int i = dice_.integer(1, 5); i > 0; --i) move(hip_ + dice_.inCube(0.004), speed());
  }
  void tremble() {
    const double amplitude = dice_.logarithmic(1e-6, 1e-4);
    const Point at = hip_;
    for (int i = dice_.integer(10, 80); i > 0; --i) addHip(at + dice_.inCube(amplitude));
  }
  void circle() {
    const Point u = dice_.direction();
    const Point v = u.cross(dice_.direction()).stableNormalized();
    const double radius = dice_.logarithmic(2e-4, 4e-3);
    const Point centre = hip_ - radius * u;
    const int ticks = dice_.integer(60, 400);
    const int turns = dice_.integer(1, 3);
    for (int i = 1; i <= ticks; ++i) {
      const double angle = 2 * std::numbers::pi * turns * i / ticks;
      addHip(centre + radius * (std::cos(angle) * u + std::sin(angle) * v));
    }
  }

  Dice dice_;
  Trial trial_;
  std::vector<Shape> shapes_;
  bool enclosed_ = false;
  Point half_ = Point::Zero();  // of the enclosure
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Point offset_ = Point::Zero();
  bool rough_ = false;
  bool damped_ = false;
  double equalStiffness_ = 0;
  Point hip_ = Point::Zero();
};

}  // namespace

std::span<const char* const> trialKinds() {
  return kKinds;
}

Trial randomTrial(std::uint64_t seed, const std::string& kind) {
  return Maker(seed, kind).make();
}

}  // namespace hapticd::truth
