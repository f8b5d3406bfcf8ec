#include "hand_in_scene.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace mujoco_example {
namespace {

using Vec = std::array<double, 3>;

constexpr std::size_t kMostSurfaces = 16;
constexpr int kFacesOfGeom = 8;
constexpr double kSameFace = 0.9;  // cosine between its normals in two calls, at least
constexpr double kStiffness_N_per_m = 1000;
constexpr double kDamping_Ns_per_m = 1;

Vec toScene(const Vec& v) {
  return {v[0], -v[2], v[1]};
}
Vec toServer(const Vec& v) {
  return {v[0], v[2], -v[1]};
}
Vec plus(const Vec& a, const Vec& b, double scale) {
  return {a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]};
}

double dot(const Vec& a, const Vec& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vec toGeom(const mjData* data, int geom, const Vec& v) {
  const double* m = data->geom_xmat + 9 * geom;  // its columns are the axes of the geom
  return {dot({m[0], m[3], m[6]}, v), dot({m[1], m[4], m[7]}, v), dot({m[2], m[5], m[8]}, v)};
}

// Of a geom that is round, the surface does not tilt where it is touched when it turns.
bool isRound(const mjModel* model, int geom) {
  const int type = model->geom_type[geom];
  return type == mjGEOM_SPHERE || type == mjGEOM_CAPSULE || type == mjGEOM_CYLINDER ||
         type == mjGEOM_ELLIPSOID;
}

struct Velocity {
  Vec turning{}, moving{};
};

// Of the material of a body at this point.
Velocity velocityAt(const mjModel* model, const mjData* data, int body, const Vec& point) {
  double v[6];
  mj_objectVelocity(model, data, mjOBJ_XBODY, body, v, 0);
  const double* origin = data->xpos + 3 * body;
  const Vec arm{point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]};
  Velocity result{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  const Vec& w = result.turning;
  const Vec turn{w[1] * arm[2] - w[2] * arm[1], w[2] * arm[0] - w[0] * arm[2], w[0] * arm[1] - w[1] * arm[0]};
  result.moving = plus(result.moving, turn, 1);
  return result;
}

}  // namespace

HandInScene::HandInScene(const std::string& file)
    : model_(nullptr, mj_deleteModel), data_(nullptr, mj_deleteData) {
  char error[1000] = "";
  model_.reset(mj_loadXML(file.c_str(), nullptr, error, sizeof error));
  if (!model_) throw std::runtime_error(file + ": " + error);
  data_.reset(mj_makeData(model_.get()));
  const int hand = mj_name2id(model_.get(), mjOBJ_BODY, "hand");
  tool_ = mj_name2id(model_.get(), mjOBJ_GEOM, "tool");
  if (hand < 0 || tool_ < 0 || model_->body_jntnum[hand] != 1 ||
      model_->jnt_type[model_->body_jntadr[hand]] != mjJNT_FREE) {
    throw std::runtime_error(file + ": needs a body \"hand\" with a free joint and a geom \"tool\"");
  }
  handQpos_ = model_->jnt_qposadr[model_->body_jntadr[hand]];
  handQvel_ = model_->jnt_dofadr[model_->body_jntadr[hand]];
  const int path = mj_name2id(model_.get(), mjOBJ_NUMERIC, "path");
  const int size = path < 0 ? 0 : model_->numeric_size[path];
  for (int i = 0; i + 3 < size; i += 4) {
    const double* n = model_->numeric_data + model_->numeric_adr[path] + i;
    path_.push_back({n[0], toServer({n[1], n[2], n[3]})});
  }
  if (path_.empty()) throw std::runtime_error(file + ": needs a custom numeric \"path\" of t x y z");
  setHand(path_.front().position_m, {});
}

HandInScene::~HandInScene() = default;

Vec HandInScene::placeAt(double time_s) const {
  const double t = path_.back().time_s > 0 ? std::fmod(time_s, path_.back().time_s) : 0;
  const auto next = std::upper_bound(path_.begin(), path_.end(), t,
                                     [](double time, const Waypoint& point) { return time < point.time_s; });
  if (next == path_.begin()) return path_.front().position_m;
  const Waypoint& before = *(next - 1);
  if (next == path_.end()) return before.position_m;
  const double share = (t - before.time_s) / (next->time_s - before.time_s);
  const Vec& a = before.position_m;
  const Vec& b = next->position_m;
  return plus(a, {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, share);
}

void HandInScene::reset() {
  mj_resetData(model_.get(), data_.get());
  pushes_.clear();
  touched_.clear();
  faces_.clear();
}

void HandInScene::setHand(const Vec& position_m, const Vec& velocity_m_per_s) {
  hand_ = toScene(position_m);
  velocity_ = toScene(velocity_m_per_s);
}

void HandInScene::setForces(const std::vector<hapticd::RemoteContactForce>& forces) {
  pushes_.clear();
  for (const hapticd::RemoteContactForce& felt : forces) {
    const auto at = touched_.find(felt.id);
    if (at == touched_.end()) continue;
    Push push = at->second;
    push.force = toScene({-felt.force_N[0], -felt.force_N[1], -felt.force_N[2]});
    pushes_.push_back(push);
  }
}

void HandInScene::step(double seconds) {
  const int steps = static_cast<int>(std::lround(seconds / model_->opt.timestep));
  for (int i = 0; i < steps; ++i) {
    double* q = data_->qpos + handQpos_;
    double* v = data_->qvel + handQvel_;
    std::copy(hand_.begin(), hand_.end(), q);
    const double upright[4] = {1, 0, 0, 0};
    std::copy(upright, upright + 4, q + 3);
    std::copy(velocity_.begin(), velocity_.end(), v);
    std::fill(v + 3, v + 6, 0.0);
    std::fill(data_->qfrc_applied, data_->qfrc_applied + model_->nv, 0.0);
    for (const Push& push : pushes_) {
      const double none[3] = {0, 0, 0};
      mj_applyFT(model_.get(), data_.get(), push.force.data(), none, push.point.data(), push.body,
                 data_->qfrc_applied);
    }
    mj_step(model_.get(), data_.get());
  }
}

std::vector<hapticd::RemoteContact> HandInScene::surfaces() {
  // As the bodies are now, not as they were before the last step.
  std::copy(hand_.begin(), hand_.end(), data_->qpos + handQpos_);
  mj_forward(model_.get(), data_.get());
  std::vector<int> near;
  for (int i = 0; i < data_->ncon; ++i) {
    if (data_->contact[i].geom1 == tool_ || data_->contact[i].geom2 == tool_) near.push_back(i);
  }
  std::stable_sort(near.begin(), near.end(),
                   [&](int a, int b) { return data_->contact[a].dist < data_->contact[b].dist; });
  if (near.size() > kMostSurfaces) near.resize(kMostSurfaces);
  touched_.clear();
  std::map<int, Vec> faces;
  std::vector<hapticd::RemoteContact> surfaces;
  for (const int i : near) {
    const mjContact& contact = data_->contact[i];
    const bool toTool = contact.geom2 == tool_;
    const int geom = toTool ? contact.geom1 : contact.geom2;
    const int body = model_->geom_bodyid[geom];
    const double out = toTool ? 1 : -1;  // MuJoCo's normal points from the first geom to the second
    const Vec normal{out * contact.frame[0], out * contact.frame[1], out * contact.frame[2]};
    const Vec point{contact.pos[0], contact.pos[1], contact.pos[2]};
    const Velocity velocity = velocityAt(model_.get(), data_.get(), body, point);
    hapticd::RemoteContact surface;
    const Vec face = toGeom(data_.get(), geom, normal);
    surface.id = numberOf(geom, face, faces);
    if (surface.id < 0) continue;
    faces[surface.id] = face;
    // The server's hand is a point: the plane lies as far from it as the surface from the tool.
    surface.point_m = toServer(plus(hand_, normal, -contact.dist));
    surface.normal = toServer(normal);
    surface.velocity_m_per_s = toServer(velocity.moving);
    if (!isRound(model_.get(), geom)) surface.angularVelocity_rad_per_s = toServer(velocity.turning);
    surface.stiffness_N_per_m = kStiffness_N_per_m;
    surface.damping_Ns_per_m = kDamping_Ns_per_m;
    surface.staticFriction = std::min(1.0, contact.friction[0]);
    surface.dynamicFriction = 0.8 * surface.staticFriction;
    surface.yields = model_->body_weldid[body] != 0;
    surfaces.push_back(surface);
    touched_[surface.id] = {body, point, {}};
  }
  faces_ = std::move(faces);
  return surfaces;
}

// The same face keeps its number, in whatever order MuJoCo finds the contacts of a geom: that of the most
// similar face of the last call, else one that is new. -1: the geom has no more.
int HandInScene::numberOf(int geom, const Vec& face, const std::map<int, Vec>& taken) const {
  int number = -1;
  double mostSimilar = -1;
  for (int id = kFacesOfGeom * geom; id < kFacesOfGeom * (geom + 1); ++id) {
    if (taken.count(id) != 0) continue;
    const auto before = faces_.find(id);
    const double similar = before == faces_.end() ? kSameFace : dot(before->second, face);
    if (number >= 0 && similar <= mostSimilar) continue;
    number = id;
    mostSimilar = similar;
  }
  return number;
}

}  // namespace mujoco_example
