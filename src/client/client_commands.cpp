// From calls to messages of the wire.
#include "client/client_impl.h"

namespace hapticd {

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
  setSurfaceProperty(object, "static friction", s.staticFriction);
  setSurfaceProperty(object, "dynamic friction", s.dynamicFriction);
  setSurfaceProperty(object, "popthrough", s.popthrough);
  setSurfaceProperty(object, "mass", s.mass_kg);
}
void Client::setSurfaceProperty(int object, std::string_view property, float value) {
  Impl::requireFits("setSurfaceProperty()", property, decltype(wire::SetHapticProperty::property)::kMost);
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
  impl_->send(wire::Effect{nameOf(e.type), index, e.gain, e.magnitude_N, e.duration_ms, e.frequency,
                           e.position, e.direction});
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
void Client::setTriangle(int object, int triangle, const std::array<int, 3>& vertices,
                         const std::array<int, 3>& normals) {
  impl_->send(wire::SetTriangle{object, triangle, vertices, normals});
}
void Client::removeTriangle(int object, int triangle) {
  impl_->send(wire::RemoveTriangle{object, triangle});
}
void Client::updateMesh(int object, const Surface& s) {
  impl_->send(
      wire::UpdateTrimeshChanges{object, s.stiffness, s.damping, s.staticFriction, s.dynamicFriction});
}
void Client::transformMesh(int object, const std::array<float, 16>& rowMajor) {
  impl_->send(wire::TransformTrimesh{object, rowMajor});
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
  impl_->send(wire::Plane{p.plane, p.stiffness, p.damping, p.dynamicFriction, p.staticFriction, p.index,
                          p.recovery_ms});
}
void Client::setPlaneTexture(const PlaneTexture& t) {
  impl_->send(wire::Plane2{t.normalAdhesion_N, t.lateralAdhesion_N, t.textureAmplitude_m,
                           t.textureWavelength_m, t.buzzAmplitude_m, t.buzzFrequency_Hz});
}
// Stock VRPN removes a plane by a zero normal.
void Client::stopPlane(int index) {
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
  impl_->updateRate_Hz = rate_Hz;
  if (connected()) impl_->send(wire::TrackerSetUpdateRate{rate_Hz});
}
void Client::resetOrigin() {
  impl_->send(wire::TrackerResetOrigin{});
}
void Client::setButtonMode(int button, ButtonMode mode) {
  impl_->send(wire::ButtonAdmin{button, static_cast<std::int32_t>(mode)});
}
void Client::sendText(std::string_view text, Severity severity) {
  Impl::requireFits("sendText()", text, decltype(wire::Text::text)::kMost);
  impl_->send(wire::Text{static_cast<std::uint32_t>(severity), 0, std::string(text)});
}

}  // namespace hapticd
