// From calls to messages.
#include <stdexcept>

#include "client/client_impl.h"

namespace hapticd {
namespace {

// Vertices share the time stamp of their block: asking the clock for each would cost more than encoding it.
constexpr std::size_t kBlock = 1024;
constexpr std::uint64_t kVertexFrameBytes =
    wire::kHeaderBytes + wire::padded(wire::kPayloadSize<wire::SetVertex>);

/// Follows the bytes of one upload on their way into the system.
class Upload {
 public:
  Upload(client::Link& link, std::uint64_t messages, const Client::Callback<UploadProgress>& progress)
      : link_(link),
        progress_(progress),
        start_((link.flush(), link.streamBytes())),
        connection_(link.connectionNumber()) {
    state_.bytes_total = messages * kVertexFrameBytes;
    link_.onDrainStep = [this] { report(); };
  }
  ~Upload() { link_.onDrainStep = nullptr; }
  Upload(const Upload&) = delete;
  Upload& operator=(const Upload&) = delete;

  void check() const {
    if (!link_.connected() || link_.connectionNumber() != connection_) {
      throw ConnectionLost("connection to " + link_.server().text() + " lost after " +
                           std::to_string(state_.bytes_sent) + " of " + std::to_string(state_.bytes_total) +
                           " bytes of a mesh: " + link_.whyNotConnected());
    }
  }

  void finish() {
    link_.drainTo(0);
    report();
  }

 private:
  void report() {
    const std::uint64_t taken = link_.streamBytesTaken();
    const std::uint64_t sent = taken > start_ ? std::min(taken - start_, state_.bytes_total) : 0;
    if (sent == state_.bytes_sent && sent > 0) return;
    state_.bytes_sent = sent;
    if (progress_) progress_(state_);
  }

  client::Link& link_;
  const Client::Callback<UploadProgress>& progress_;
  std::uint64_t start_;
  std::uint64_t connection_;
  UploadProgress state_;
};

template <class CornerAt>
void upload(client::Link& link, wire::LocalSender sender, int object, std::size_t count,
            const Client::Callback<UploadProgress>& progress, CornerAt&& cornerAt) {
  Upload upload(link, count, progress);
  for (std::size_t block = 0; block < count; block += kBlock) {
    upload.check();
    const wire::Time now = client::wireNow();
    for (std::size_t i = block; i < std::min(count, block + kBlock); ++i) {
      link.send(now, sender, wire::SetVertex{object, static_cast<std::int32_t>(i), cornerAt(i)});
    }
  }
  upload.check();
  upload.finish();
}

}  // namespace

void Client::uploadMesh(int object, const MeshView& mesh, const Callback<UploadProgress>& progress) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t vertex : mesh.triangles[t]) {
      if (vertex >= mesh.vertices.size()) {
        throw std::invalid_argument("triangle " + std::to_string(t) + " names vertex " +
                                    std::to_string(vertex) + ", the mesh has " +
                                    std::to_string(mesh.vertices.size()));
      }
    }
  }
  if (!connected()) waitConnected(impl_->options.connect_timeout);
  upload(impl_->link, impl_->sender, object, mesh.triangles.size() * 3, progress,
         [&](std::size_t i) { return mesh.vertices[mesh.triangles[i / 3][i % 3]]; });
}

void Client::uploadCorners(int object, std::span<const std::array<float, 3>> corners,
                           const Callback<UploadProgress>& progress) {
  if (!connected()) waitConnected(impl_->options.connect_timeout);
  upload(impl_->link, impl_->sender, object, corners.size(), progress,
         [&](std::size_t i) { return corners[i]; });
}

// --- scene, world units

void Client::setObjectCount(int count) {
  impl_->send(wire::SetObjectNumber{count});
}
void Client::setVertex(int object, int vertex, float x, float y, float z) {
  impl_->send(wire::SetVertex{object, vertex, {x, y, z}});
}
void Client::setSurface(int object, const Surface& s) {
  setSurfaceProperty(object, "stiffness", s.stiffness);
  setSurfaceProperty(object, "damping", s.damping);
  setSurfaceProperty(object, "static friction", s.static_friction);
  setSurfaceProperty(object, "dynamic friction", s.dynamic_friction);
  setSurfaceProperty(object, "popthrough", s.popthrough);
  setSurfaceProperty(object, "mass", s.mass_kg);
}
void Client::setSurfaceProperty(int object, std::string_view property, float value) {
  impl_->send(wire::SetHapticProperty{object, property, value});
}
void Client::setTransform(int object, const Matrix4& T_world_object) {
  impl_->send(wire::SetTransformMatrix{object, T_world_object});
}
void Client::setTouchable(int object, bool touchable) {
  impl_->send(wire::SetObjectIsTouchable{object, static_cast<wire::Bool16>(touchable)});
}
void Client::setTouchableFaces(Faces faces) {
  impl_->send(wire::SetTouchableFace{static_cast<std::int32_t>(faces)});
}
void Client::setWorkspaceBox(const Box& box, const Matrix4& model) {
  impl_->send(wire::SetWorkspaceBoundingBox{
      model, {box.min[0], box.min[1], box.min[2], box.max[0], box.max[1], box.max[2]}});
}
void Client::setWorkspaceProjection(const Matrix4& model, const Matrix4& projection) {
  impl_->send(wire::SetWorkspaceProjectionMatrix{model, projection});
}
void Client::setEffect(int index, const Effect& e) {
  impl_->send(wire::Effect{e.type, index, e.gain, e.magnitude_N, e.duration_ms, e.frequency, e.position,
                           e.direction});
}
void Client::startEffect(int index) {
  impl_->send(wire::StartEffect{index});
}
void Client::stopEffect(int index) {
  impl_->send(wire::StopEffect{index});
}
void Client::resetScene() {
  impl_->send(wire::ResetScene{});
}

// --- stock scene, metres

void Client::addObject(int object, int parent) {
  impl_->send(wire::AddObject{object, parent});
}
void Client::addObjectOutsideScene(int object) {
  impl_->send(wire::AddObjectExScene{object});
}
void Client::moveToParent(int object, int parent) {
  impl_->send(wire::MoveToParent{object, parent});
}
void Client::removeObject(int object) {
  impl_->send(wire::RemoveObject{object});
}
void Client::setObjectPosition(int object, const std::array<float, 3>& position_m) {
  impl_->send(wire::SetObjectPosition{object, position_m});
}
void Client::setObjectOrientation(int object, const std::array<float, 3>& axis, float angle_rad) {
  impl_->send(wire::SetObjectOrientation{object, axis, angle_rad});
}
void Client::setObjectScale(int object, const std::array<float, 3>& scale) {
  impl_->send(wire::SetObjectScale{object, scale});
}
void Client::setNormal(int object, int normal, float x, float y, float z) {
  impl_->send(wire::SetNormal{object, normal, {x, y, z}});
}
void Client::setTriangle(int object, int triangle, const std::array<std::int32_t, 3>& vertices,
                         const std::array<std::int32_t, 3>& normals) {
  impl_->send(wire::SetTriangle{object, triangle, vertices, normals});
}
void Client::removeTriangle(int object, int triangle) {
  impl_->send(wire::RemoveTriangle{object, triangle});
}
void Client::updateMesh(int object, const Surface& s) {
  impl_->send(
      wire::UpdateTrimeshChanges{object, s.stiffness, s.damping, s.static_friction, s.dynamic_friction});
}
void Client::transformMesh(int object, const std::array<float, 16>& row_major) {
  impl_->send(wire::TransformTrimesh{object, row_major});
}
void Client::setMeshType(int object, int type) {
  impl_->send(wire::SetTrimeshType{object, type});
}
void Client::clearMesh(int object) {
  impl_->send(wire::ClearTrimesh{object});
}
void Client::setHapticOrigin(const std::array<float, 3>& position_m, const std::array<float, 3>& axis,
                             float angle_rad) {
  impl_->send(wire::SetHapticOrigin{position_m, axis, angle_rad});
}
void Client::setHapticScale(float scale) {
  impl_->send(wire::SetHapticScale{scale});
}
void Client::setSceneOrigin(const std::array<float, 3>& position_m, const std::array<float, 3>& axis,
                            float angle_rad) {
  impl_->send(wire::SetSceneOrigin{position_m, axis, angle_rad});
}

// --- stock forces, metres

void Client::setPlane(const Plane& p) {
  impl_->send(wire::Plane{p.plane, p.stiffness, p.damping, p.dynamic_friction, p.static_friction, p.index,
                          p.recovery_cycles});
}
void Client::setPlaneTexture(const PlaneTexture& t) {
  impl_->send(wire::Plane2{t.normal_adhesion, t.lateral_adhesion, t.texture_amplitude, t.texture_wavelength,
                           t.buzz_amplitude, t.buzz_frequency_Hz});
}
// A plane without a normal is none: how stock VRPN takes one away.
void Client::stopPlane(std::int32_t index) {
  wire::Plane none;
  none.index = index;
  impl_->send(none);
}
void Client::setForceField(const ForceField& field) {
  impl_->sendFast(wire::ForceField{field.origin_m, field.force_N, field.jacobian_N_per_m, field.radius_m});
}
void Client::stopForceField() {
  impl_->send(wire::ForceField{});
}
void Client::constrainToPoint(const std::array<float, 3>& point_m, float stiffness_N_per_m) {
  impl_->send(wire::ConstraintMode{1});
  impl_->send(wire::ConstraintPoint{point_m});
  impl_->send(wire::ConstraintStiffness{stiffness_N_per_m});
  impl_->send(wire::ConstraintEnable{1});
}
void Client::constrainToLine(const std::array<float, 3>& point_m, const std::array<float, 3>& direction,
                             float stiffness_N_per_m) {
  impl_->send(wire::ConstraintMode{2});
  impl_->send(wire::ConstraintLinePoint{point_m});
  impl_->send(wire::ConstraintLineDirection{direction});
  impl_->send(wire::ConstraintStiffness{stiffness_N_per_m});
  impl_->send(wire::ConstraintEnable{1});
}
void Client::constrainToPlane(const std::array<float, 3>& point_m, const std::array<float, 3>& normal,
                              float stiffness_N_per_m) {
  impl_->send(wire::ConstraintMode{3});
  impl_->send(wire::ConstraintPlanePoint{point_m});
  impl_->send(wire::ConstraintPlaneNormal{normal});
  impl_->send(wire::ConstraintStiffness{stiffness_N_per_m});
  impl_->send(wire::ConstraintEnable{1});
}
void Client::releaseConstraint() {
  impl_->send(wire::ConstraintEnable{0});
}
void Client::startCustomEffect(std::uint32_t effect, std::span<const float> parameters) {
  impl_->send(wire::CustomEffect{effect, {{parameters.begin(), parameters.end()}}});
}
void Client::stopCustomEffect() {
  impl_->send(wire::CustomEffect{wire::kStopCustomEffect, {}});
}

// --- tracker and buttons

void Client::requestToRoom() {
  impl_->send(wire::TrackerRequestToRoom{});
}
void Client::requestUnitToSensor() {
  impl_->send(wire::TrackerRequestUnitToSensor{});
}
void Client::requestWorkspace() {
  impl_->send(wire::TrackerRequestWorkspace{});
}
void Client::setUpdateRate(double rate_Hz) {
  impl_->send(wire::TrackerSetUpdateRate{rate_Hz});
}
void Client::resetOrigin() {
  impl_->send(wire::TrackerResetOrigin{});
}
void Client::setButtonMode(int button, ButtonMode mode) {
  impl_->send(wire::ButtonAdmin{button, static_cast<std::int32_t>(mode)});
}
void Client::sendText(std::string_view text, Severity severity) {
  impl_->send(wire::Text{static_cast<std::uint32_t>(severity), 0, std::string(text)});
}

}  // namespace hapticd
