// The scene as SVG: faces of all geoms, the farthest first. MuJoCo's own renderer needs OpenGL.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "hand_in_scene.h"

namespace mujoco_example {
namespace {

using Vec = std::array<double, 3>;

constexpr double kPixelsPerMetre = 3200;
constexpr int kWidth = 720;
constexpr int kHeight = 560;
constexpr double kMetresPerNewton = 0.02;
constexpr int kAround = 20;  // faces around a round shape

struct Face {
  std::vector<Vec> corners;
  Vec normal{};
  const float* rgba = nullptr;
};

double dot(const Vec& a, const Vec& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// From the front, a little from the right and from above.
constexpr double kTurn = 0.45;
constexpr double kTilt = 0.42;
const Vec kRight{std::cos(kTurn), std::sin(kTurn), 0};
const Vec kUp{-std::sin(kTurn) * std::sin(kTilt), std::cos(kTurn) * std::sin(kTilt), std::cos(kTilt)};
const Vec kToEye{std::sin(kTurn) * std::cos(kTilt), -std::cos(kTurn) * std::cos(kTilt), std::sin(kTilt)};
const Vec kLight{0.25, -0.45, 0.86};

std::array<double, 2> onPaper(const Vec& p) {
  return {kWidth / 2.0 + kPixelsPerMetre * dot(p, kRight), 0.46 * kHeight - kPixelsPerMetre * dot(p, kUp)};
}

// A point of a geom in the world.
Vec placed(const mjModel*, const mjData* data, int geom, const Vec& local) {
  const double* origin = data->geom_xpos + 3 * geom;
  const double* axes = data->geom_xmat + 9 * geom;
  Vec world{};
  for (std::size_t i = 0; i < 3; ++i) {
    world[i] = origin[i] + axes[3 * i] * local[0] + axes[3 * i + 1] * local[1] + axes[3 * i + 2] * local[2];
  }
  return world;
}

void addFace(std::vector<Face>& faces, const mjModel* model, const mjData* data, int geom,
             const std::vector<Vec>& local) {
  Face face;
  for (const Vec& corner : local) face.corners.push_back(placed(model, data, geom, corner));
  const Vec &a = face.corners[0], &b = face.corners[1], &c = face.corners[2];
  const Vec u{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const Vec v{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  face.normal = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  const double size = std::sqrt(dot(face.normal, face.normal));
  if (size == 0) return;
  for (double& n : face.normal) n /= size;
  face.rgba = model->geom_rgba + 4 * geom;
  if (dot(face.normal, kToEye) > 0) faces.push_back(std::move(face));
}

// Large faces are cut, so that sorting by their middles is right.
void addBox(std::vector<Face>& faces, const mjModel* model, const mjData* data, int geom) {
  const double* size = model->geom_size + 3 * geom;
  constexpr int kCuts = 6;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const std::size_t u = (axis + 1) % 3;
      const std::size_t v = (axis + 2) % 3;
      for (int i = 0; i < kCuts; ++i) {
        for (int j = 0; j < kCuts; ++j) {
          std::vector<Vec> corners;
          for (const auto& [du, dv] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
            Vec corner{};
            corner[axis] = side * size[axis];
            corner[u] = size[u] * (2.0 * (i + du) / kCuts - 1);
            corner[v] = size[v] * (2.0 * (j + dv) / kCuts - 1);
            corners.push_back(corner);
          }
          if (side < 0) std::reverse(corners.begin(), corners.end());
          addFace(faces, model, data, geom, corners);
        }
      }
    }
  }
}

// A sphere, or two halves with a cylinder between them.
void addRound(std::vector<Face>& faces, const mjModel* model, const mjData* data, int geom) {
  const double radius = model->geom_size[3 * geom];
  const double half = model->geom_type[geom] == mjGEOM_SPHERE ? 0 : model->geom_size[3 * geom + 1];
  constexpr int kRings = 12;
  std::vector<std::pair<double, double>> profile;  // radius and height
  for (int ring = 0; ring <= kRings; ++ring) {
    const double angle = mjPI * (ring / static_cast<double>(kRings) - 0.5);
    const double height = radius * std::sin(angle);
    profile.emplace_back(radius * std::cos(angle), height + (2 * ring < kRings ? -half : half));
  }
  for (std::size_t ring = 0; ring + 1 < profile.size(); ++ring) {
    for (int i = 0; i < kAround; ++i) {
      const auto at = [&](std::size_t r, int k) {
        const double angle = 2 * mjPI * k / kAround;
        return Vec{profile[r].first * std::cos(angle), profile[r].first * std::sin(angle), profile[r].second};
      };
      // The ring at a pole has no width: begin at the wider one.
      if (ring == 0) {
        addFace(faces, model, data, geom, {at(1, i + 1), at(1, i), at(0, i)});
      } else {
        addFace(faces, model, data, geom,
                {at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)});
      }
    }
  }
}

}  // namespace

std::string HandInScene::picture() const {
  std::vector<Face> faces;
  for (int geom = 0; geom < model_->ngeom; ++geom) {
    switch (model_->geom_type[geom]) {
      case mjGEOM_BOX:
        addBox(faces, model_.get(), data_.get(), geom);
        break;
      case mjGEOM_SPHERE:
      case mjGEOM_CAPSULE:
        addRound(faces, model_.get(), data_.get(), geom);
        break;
      default:
        break;
    }
  }
  const auto depth = [](const Face& face) {
    double sum = 0;
    for (const Vec& corner : face.corners) sum += dot(corner, kToEye);
    return sum / static_cast<double>(face.corners.size());
  };
  std::stable_sort(faces.begin(), faces.end(),
                   [&](const Face& a, const Face& b) { return depth(a) < depth(b); });

  std::string svg;
  char line[256];
  std::snprintf(line, sizeof line, "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\">\n",
                kWidth, kHeight);
  svg += line;
  svg += "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n";
  for (const Face& face : faces) {
    const double light = 0.45 + 0.55 * std::max(0.0, dot(face.normal, kLight));
    const auto shade = [&](int i) {
      return static_cast<int>(255 * std::min(1.0, light * static_cast<double>(face.rgba[i])));
    };
    std::snprintf(line, sizeof line,
                  "<path fill=\"#%02x%02x%02x\" stroke=\"#%02x%02x%02x\" stroke-width=\".6\" d=\"M", shade(0),
                  shade(1), shade(2), shade(0), shade(1), shade(2));
    svg += line;
    for (const Vec& corner : face.corners) {
      const auto [x, y] = onPaper(corner);
      std::snprintf(line, sizeof line, "%.1f %.1f ", x, y);
      svg += line;
    }
    svg += "z\"/>\n";
  }
  for (const Push& push : pushes_) {
    const auto [x, y] = onPaper(push.point);
    const auto [toX, toY] = onPaper({push.point[0] + kMetresPerNewton * push.force[0],
                                     push.point[1] + kMetresPerNewton * push.force[1],
                                     push.point[2] + kMetresPerNewton * push.force[2]});
    std::snprintf(line, sizeof line,
                  "<path d=\"M%.1f %.1fL%.1f %.1f\" stroke=\"#c00\" stroke-width=\"4\"/><circle cx=\"%.1f\" "
                  "cy=\"%.1f\" r=\"6\" fill=\"#c00\"/>\n",
                  x, y, toX, toY, toX, toY);
    svg += line;
  }
  return svg + "</svg>\n";
}

}  // namespace mujoco_example
