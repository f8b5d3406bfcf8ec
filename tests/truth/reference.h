// The geometry of a trial at one tick, by brute force over all triangles: no index, no cache, and no code of
// the renderer.
//
// It does not compute a proxy. It answers what a judge has to ask: which faces a path crosses, how far they
// are, and where a point that rides on a face is now.
#pragma once

#include <vector>

#include "truth/trial.h"

namespace hapticd::truth {

/// In roundings: on a plane within these. Corners of neighbours are rounded each on their own.
inline constexpr double kOnPlane = 4;

/// One triangle at one tick, device metres.
struct Face {
  Point a, b, c;
  Point normal;            ///< unit, out of the front
  int object = 0;          ///< -1 - index for a plane of the scene
  bool unbounded = false;  ///< a plane: through a, solid below
  double width = 0;        ///< smallest height of the triangle
  /// So thin that a renderer may leave it out, because its rounding hides it: it may be felt and it may be
  /// missed.
  bool thin = false;
};

/// Point of a triangle that is nearest to x.
Point nearestOf(const Face& face, const Point& x);
/// Distance of the segment p-q from a triangle; 0 when they cross.
double distanceOf(const Face& face, const Point& p, const Point& q);

class Reference {
 public:
  explicit Reference(const Trial& trial);

  /// To the geometry of a tick; that of the tick before is kept to carry points.
  void moveTo(int tick);
  /// Whether anything moved or deformed in this tick.
  bool moved() const { return moved_; }

  const std::vector<Face>& faces() const { return faces_; }
  const Face& face(int i) const { return faces_[static_cast<std::size_t>(i)]; }
  const Material& materialOf(int face) const;
  /// Heights of a point above all faces, in the order of faces(); valid until `out` is reused.
  void heights(const Point& x, Eigen::ArrayXd& out) const;
  /// Faces within `radius` of x.
  std::vector<int> near(const Point& x, double radius) const;
  /// Where a point is now that was fixed to the face at the previous tick.
  Point carried(const Point& p, int face) const;
  /// The same for a whole object, as a rigid body.
  Point carriedByObject(const Point& p, int object) const;

  /// Whether the straight path goes through the face, widened by `widening`, from a side that can be touched.
  bool crosses(int face, const Point& p, const Point& q, double widening) const;
  /// The same from either side, touchable or not.
  bool pierces(int face, const Point& p, const Point& q, double widening) const;
  /// Whether a tool at this height above a face is on a side of it that can be touched.
  bool touchableFrom(const Face& f, double height) const {
    if (f.unbounded) return height >= 0;
    return trial_.sides == Sides::both || (trial_.sides == Sides::front) == (height >= 0);
  }
  /// Whether a point is on the plane of a face, within rounding: its side is not known.
  bool onPlane(const Face& f, const Point& p) const;
  /// Of coordinates, which are floats: no side is decided below it.
  double rounding() const;
  /// Largest coordinate of all geometry.
  double extent() const { return extent_; }

 private:
  struct Placement {
    Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
    Point origin = Point::Zero();
  };
  static Placement placementAt(const TrialObject& object, int tick);
  void place(std::size_t object, int tick);
  void setHeights(std::size_t face);

  const Trial& trial_;
  int tick_ = -1;
  bool moved_ = false;
  double extent_ = 0;
  std::vector<Face> faces_;
  std::vector<Face> facesBefore_;
  std::vector<std::size_t> firstFace_;  // of each object, and the end
  std::vector<Placement> placements_;
  std::vector<Placement> placementsBefore_;
  Eigen::ArrayXd normalX_, normalY_, normalZ_, offset_;
};

}  // namespace hapticd::truth
