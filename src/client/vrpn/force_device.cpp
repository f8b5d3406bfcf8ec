#include "hapticd/vrpn/vrpn_ForceDevice.h"

#include <cmath>
#include <limits>

#include "client/vrpn/messages.h"

namespace wire = hapticd::wire;
using hapticd::client::arrayOf;
using hapticd::client::copyTo;
using hapticd::client::receiveMessage;
using hapticd::client::sendMessage;

vrpn_ForceDevice::vrpn_ForceDevice(const char* name, vrpn_Connection* connection)
    : vrpn_BaseClass(name, connection) {
  vrpn_ForceDevice::register_types();
}

int vrpn_ForceDevice::register_types() {
  if (!d_connection) return 0;
  const auto type = [this](const char* name) { return d_connection->register_message_type(name); };
  force_message_id = type("vrpn_ForceDevice Force");
  scp_message_id = type("vrpn_ForceDevice SCP");
  error_message_id = type("vrpn_ForceDevice Force_Error");
  plane_message_id = type("vrpn_ForceDevice Plane");
  plane_effects_message_id = type("vrpn_ForceDevice Plane2");
  forcefield_message_id = type("vrpn_ForceDevice Force_Field");
  custom_effect_message_id = type("vrpn_ForceDevice Custom Effect");
  addObject_message_id = type("vrpn_ForceDevice addObject");
  addObjectExScene_message_id = type("vrpn_ForceDevice addObjectExScene");
  moveToParent_message_id = type("vrpn_ForceDevice moveToParent");
  setObjectPosition_message_id = type("vrpn_ForceDevice setObjectPosition");
  setObjectOrientation_message_id = type("vrpn_ForceDevice setObjectOrientation");
  setObjectScale_message_id = type("vrpn_ForceDevice setObjectScale");
  removeObject_message_id = type("vrpn_ForceDevice removeObject");
  setVertex_message_id = type("vrpn_ForceDevice setVertex");
  setNormal_message_id = type("vrpn_ForceDevice setNormal");
  setTriangle_message_id = type("vrpn_ForceDevice setTriangle");
  removeTriangle_message_id = type("vrpn_ForceDevice removeTriangle");
  updateTrimeshChanges_message_id = type("vrpn_ForceDevice updateTrimeshChanges");
  transformTrimesh_message_id = type("vrpn_ForceDevice transformTrimesh");
  setTrimeshType_message_id = type("vrpn_ForceDevice setTrimeshType");
  clearTrimesh_message_id = type("vrpn_ForceDevice clearTrimesh");
  setHapticOrigin_message_id = type("vrpn_ForceDevice setHapticOrigin");
  setHapticScale_message_id = type("vrpn_ForceDevice setHapticScale");
  setSceneOrigin_message_id = type("vrpn_ForceDevice setSceneOrigin");
  getNewObjectID_message_id = type("vrpn_ForceDevice getNewObjectID");
  setObjectIsTouchable_message_id = type("vrpn_ForceDevice setObjectIsTouchable");
  enableConstraint_message_id = type("vrpn_ForceDevice constraint_enable");
  setConstraintMode_message_id = type("vrpn_ForceDevice constraint_mode");
  setConstraintPoint_message_id = type("vrpn_ForceDevice constraint_point");
  setConstraintLinePoint_message_id = type("vrpn_ForceDevice constraint_linept");
  setConstraintLineDirection_message_id = type("vrpn_ForceDevice constraint_linedir");
  setConstraintPlanePoint_message_id = type("vrpn_ForceDevice constraint_plpt");
  setConstraintPlaneNormal_message_id = type("vrpn_ForceDevice constraint_plnorm");
  setConstraintKSpring_message_id = type("vrpn_ForceDevice constraint_KSpring");
  return 0;
}

void vrpn_ForceDevice::print_report() {
  printf("force of %s: %g %g %g N; surface contact point: %g %g %g m, quaternion %g %g %g %g\n",
         d_servicename, force[0], force[1], force[2], scp_pos[0], scp_pos[1], scp_pos[2], scp_quat[0],
         scp_quat[1], scp_quat[2], scp_quat[3]);
}

void vrpn_ForceDevice::print_plane() {
  printf("plane of %s: %g %g %g %g\n", d_servicename, static_cast<double>(plane[0]),
         static_cast<double>(plane[1]), static_cast<double>(plane[2]), static_cast<double>(plane[3]));
}

void vrpn_ForceDevice::sendError(int code) {
  errorCode = code;
  sendMessage(d_connection, d_sender_id, wire::ForceError{code});
}

// --- settings that are sent later

void vrpn_ForceDevice::setCustomEffect(vrpn_int32 effect, vrpn_float32* parameters, vrpn_uint32 count) {
  customEffectId = effect;
  customEffectParams.assign(parameters, parameters + (parameters ? count : 0));
}
void vrpn_ForceDevice::setFF_Origin(vrpn_float32 x, vrpn_float32 y, vrpn_float32 z) {
  ff_origin[0] = x;
  ff_origin[1] = y;
  ff_origin[2] = z;
}
void vrpn_ForceDevice::setFF_Force(vrpn_float32 x, vrpn_float32 y, vrpn_float32 z) {
  ff_force[0] = x;
  ff_force[1] = y;
  ff_force[2] = z;
}
void vrpn_ForceDevice::setFF_Jacobian(vrpn_float32 xx, vrpn_float32 xy, vrpn_float32 xz, vrpn_float32 yx,
                                      vrpn_float32 yy, vrpn_float32 yz, vrpn_float32 zx, vrpn_float32 zy,
                                      vrpn_float32 zz) {
  const vrpn_float32 rows[3][3] = {{xx, xy, xz}, {yx, yy, yz}, {zx, zy, zz}};
  std::copy(&rows[0][0], &rows[0][0] + 9, &ff_jacobian[0][0]);
}
void vrpn_ForceDevice::set_plane(vrpn_float32 a, vrpn_float32 b, vrpn_float32 c, vrpn_float32 d) {
  plane[0] = a;
  plane[1] = b;
  plane[2] = c;
  plane[3] = d;
}

// --- reports

vrpn_ForceDevice_Remote::vrpn_ForceDevice_Remote(const char* name, vrpn_Connection* connection)
    : vrpn_ForceDevice(name, connection) {
  listen("vrpn_ForceDevice Force", handleForce, this);
  listen("vrpn_ForceDevice SCP", handleScp, this);
  listen("vrpn_ForceDevice Force_Error", handleError, this);
  listen("vrpn_ForceDevice DOP", handleDop, this);
  listen("vrpn_ForceDevice isTouching", handleTouching, this);
  listen("vrpn_ForceDevice TouchedObject", handleObject, this);
  listen("vrpn_ForceDevice Angle", handleAngle, this);
}

int vrpn_ForceDevice_Remote::handleForce(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::Force>(p, [&](const wire::Force& m) {
    vrpn_FORCECB report{p.msg_time, {}};
    copyTo(report.force, m.force);
    copyTo(static_cast<vrpn_ForceDevice_Remote*>(self)->force, m.force);
    static_cast<vrpn_ForceDevice_Remote*>(self)->forces_.call_handlers(report);
  });
}
int vrpn_ForceDevice_Remote::handleScp(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::Scp>(p, [&](const wire::Scp& m) {
    vrpn_FORCESCPCB report{p.msg_time, {}, {}};
    copyTo(report.pos, m.position);
    copyTo(report.quat, m.orientation);
    copyTo(static_cast<vrpn_ForceDevice_Remote*>(self)->scp_pos, m.position);
    copyTo(static_cast<vrpn_ForceDevice_Remote*>(self)->scp_quat, m.orientation);
    static_cast<vrpn_ForceDevice_Remote*>(self)->scps_.call_handlers(report);
  });
}
int vrpn_ForceDevice_Remote::handleError(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::ForceError>(p, [&](const wire::ForceError& m) {
    static_cast<vrpn_ForceDevice_Remote*>(self)->errors_.call_handlers({p.msg_time, m.code});
  });
}
int vrpn_ForceDevice_Remote::handleDop(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::Dop>(p, [&](const wire::Dop& m) {
    static_cast<vrpn_ForceDevice_Remote*>(self)->dops_.call_handlers({p.msg_time, m.depth});
  });
}
int vrpn_ForceDevice_Remote::handleTouching(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::IsTouching>(p, [&](const wire::IsTouching& m) {
    static_cast<vrpn_ForceDevice_Remote*>(self)->touchings_.call_handlers({p.msg_time, m.touching});
  });
}
int vrpn_ForceDevice_Remote::handleObject(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::TouchedObject>(p, [&](const wire::TouchedObject& m) {
    static_cast<vrpn_ForceDevice_Remote*>(self)->objects_.call_handlers({p.msg_time, m.object});
  });
}
int vrpn_ForceDevice_Remote::handleAngle(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::Angle>(p, [&](const wire::Angle& m) {
    static_cast<vrpn_ForceDevice_Remote*>(self)->angles_.call_handlers({p.msg_time, m.angle, m.touching});
  });
}

// --- commands: reliable and in order, except for those that stock VRPN streams

template <class Message>
void vrpn_ForceDevice_Remote::send(const Message& message) {
  sendMessage(d_connection, d_sender_id, message, wire::Reliability::kReliable);
}

void vrpn_ForceDevice_Remote::sendPlane(bool reliably) {
  sendMessage(d_connection, d_sender_id,
              wire::Plane{arrayOf<4>(plane), SurfaceKspring, SurfaceKdamping, SurfaceFdynamic, SurfaceFstatic,
                          which_plane, numRecCycles},
              reliably ? wire::Reliability::kReliable : wire::Reliability::kLowLatency);
}
void vrpn_ForceDevice_Remote::sendSurface() {
  sendPlane(false);
  sendMessage(d_connection, d_sender_id,
              wire::Plane2{SurfaceKadhesionNormal, SurfaceKadhesionLateral, SurfaceTextureAmplitude,
                           SurfaceTextureWavelength, SurfaceBuzzAmp, SurfaceBuzzFreq});
}
void vrpn_ForceDevice_Remote::startSurface() {
  sendPlane(true);
}
void vrpn_ForceDevice_Remote::stopSurface() {
  set_plane(0, 0, 0, 0);
  sendPlane(true);
}

void vrpn_ForceDevice_Remote::reserve(vrpn_int32 object) {
  if (object >= nextObjectId_ && object < std::numeric_limits<vrpn_int32>::max()) nextObjectId_ = object + 1;
}
void vrpn_ForceDevice_Remote::addObject(vrpn_int32 object, vrpn_int32 parent) {
  reserve(object);
  send(wire::AddObject{object, parent});
}
void vrpn_ForceDevice_Remote::addObjectExScene(vrpn_int32 object) {
  reserve(object);
  send(wire::AddObjectExScene{object});
}
void vrpn_ForceDevice_Remote::setObjectVertex(vrpn_int32 object, vrpn_int32 vertex, vrpn_float32 x,
                                              vrpn_float32 y, vrpn_float32 z) {
  send(wire::SetVertex{object, vertex, {x, y, z}});
}
void vrpn_ForceDevice_Remote::setObjectNormal(vrpn_int32 object, vrpn_int32 normal, vrpn_float32 x,
                                              vrpn_float32 y, vrpn_float32 z) {
  send(wire::SetNormal{object, normal, {x, y, z}});
}
void vrpn_ForceDevice_Remote::setObjectTriangle(vrpn_int32 object, vrpn_int32 triangle, vrpn_int32 v0,
                                                vrpn_int32 v1, vrpn_int32 v2, vrpn_int32 n0, vrpn_int32 n1,
                                                vrpn_int32 n2) {
  send(wire::SetTriangle{object, triangle, {v0, v1, v2}, {n0, n1, n2}});
}
void vrpn_ForceDevice_Remote::removeObjectTriangle(vrpn_int32 object, vrpn_int32 triangle) {
  send(wire::RemoveTriangle{object, triangle});
}
void vrpn_ForceDevice_Remote::updateObjectTrimeshChanges(vrpn_int32 object) {
  send(wire::UpdateTrimeshChanges{object, SurfaceKspring, SurfaceKdamping, SurfaceFstatic, SurfaceFdynamic});
}
void vrpn_ForceDevice_Remote::setObjectTrimeshTransform(vrpn_int32 object, vrpn_float32 row_major[16]) {
  send(wire::TransformTrimesh{object, arrayOf<16>(row_major)});
}
void vrpn_ForceDevice_Remote::setObjectPosition(vrpn_int32 object, vrpn_float32 position[3]) {
  send(wire::SetObjectPosition{object, arrayOf<3>(position)});
}
void vrpn_ForceDevice_Remote::setObjectOrientation(vrpn_int32 object, vrpn_float32 axis[3],
                                                   vrpn_float32 angle) {
  send(wire::SetObjectOrientation{object, arrayOf<3>(axis), angle});
}
void vrpn_ForceDevice_Remote::setObjectScale(vrpn_int32 object, vrpn_float32 scale[3]) {
  send(wire::SetObjectScale{object, arrayOf<3>(scale)});
}
void vrpn_ForceDevice_Remote::removeObject(vrpn_int32 object) {
  send(wire::RemoveObject{object});
}
void vrpn_ForceDevice_Remote::clearObjectTrimesh(vrpn_int32 object) {
  send(wire::ClearTrimesh{object});
}
void vrpn_ForceDevice_Remote::moveToParent(vrpn_int32 object, vrpn_int32 parent) {
  send(wire::MoveToParent{object, parent});
}
void vrpn_ForceDevice_Remote::setHapticOrigin(vrpn_float32 position[3], vrpn_float32 axis[3],
                                              vrpn_float32 angle) {
  send(wire::SetHapticOrigin{arrayOf<3>(position), arrayOf<3>(axis), angle});
}
void vrpn_ForceDevice_Remote::setHapticScale(vrpn_float32 scale) {
  send(wire::SetHapticScale{scale});
}
void vrpn_ForceDevice_Remote::setSceneOrigin(vrpn_float32 position[3], vrpn_float32 axis[3],
                                             vrpn_float32 angle) {
  send(wire::SetSceneOrigin{arrayOf<3>(position), arrayOf<3>(axis), angle});
}
void vrpn_ForceDevice_Remote::setObjectIsTouchable(vrpn_int32 object, vrpn_bool touchable) {
  send(wire::SetObjectIsTouchable{object, touchable});
}
void vrpn_ForceDevice_Remote::useHcollide() {
  send(wire::SetTrimeshType{-1, 1});
}
void vrpn_ForceDevice_Remote::useGhost() {
  send(wire::SetTrimeshType{-1, 0});
}

// --- force field and constraints

void vrpn_ForceDevice_Remote::sendField(bool reliably) {
  sendMessage(d_connection, d_sender_id,
              wire::ForceField{arrayOf<3>(ff_origin), arrayOf<3>(ff_force), arrayOf<9>(&ff_jacobian[0][0]),
                               ff_radius},
              reliably ? wire::Reliability::kReliable : wire::Reliability::kLowLatency);
}
void vrpn_ForceDevice_Remote::sendForceField() {
  sendField(false);
}
void vrpn_ForceDevice_Remote::sendForceField(vrpn_float32 origin[3], vrpn_float32 strength[3],
                                             vrpn_float32 jacobian[3][3], vrpn_float32 radius) {
  sendMessage(
      d_connection, d_sender_id,
      wire::ForceField{arrayOf<3>(origin), arrayOf<3>(strength), arrayOf<9>(&jacobian[0][0]), radius});
}
void vrpn_ForceDevice_Remote::stopForceField() {
  send(wire::ForceField{});
}

void vrpn_ForceDevice_Remote::enableConstraint(vrpn_int32 enable) {
  if ((enable != 0) == constrained_) return;
  constrained_ = enable != 0;
  if (constrained_) {
    updateConstraint();
  } else {
    stopForceField();
  }
}

// A spring to a point is -k I; one that leaves a direction d free is -k (I - d d^T); one that acts along a
// normal n only is -k n n^T.
void vrpn_ForceDevice_Remote::updateConstraint() {
  if (!constrained_ || constraintMode_ == NO_CONSTRAINT) return;
  const bool line = constraintMode_ == LINE_CONSTRAINT;
  const bool ontoPlane = constraintMode_ == PLANE_CONSTRAINT;
  const vrpn_float32* origin = line        ? constraintLinePoint_
                               : ontoPlane ? constraintPlanePoint_
                                           : constraintPoint_;
  const vrpn_float32* direction = line ? constraintLineDirection_ : constraintPlaneNormal_;
  const float length = std::hypot(direction[0], direction[1], direction[2]);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const float along = length > 0 ? direction[i] * direction[j] / (length * length) : 0.0F;
      const float free = (i == j ? 1.0F : 0.0F) - (line ? along : 0.0F);
      ff_jacobian[i][j] = 0.0F - constraintStiffness_ * (ontoPlane ? along : free);
    }
  }
  setFF_Origin(origin[0], origin[1], origin[2]);
  setFF_Force(0, 0, 0);
  setFF_Radius(100);  // metres: everywhere
  sendField(true);
}

void vrpn_ForceDevice_Remote::setConstraintMode(ConstraintGeometry mode) {
  constraintMode_ = mode;
  if (constrained_ && mode == NO_CONSTRAINT) return stopForceField();
  updateConstraint();
}
void vrpn_ForceDevice_Remote::setConstraintPoint(vrpn_float32 point[3]) {
  std::copy(point, point + 3, constraintPoint_);
  updateConstraint();
}
void vrpn_ForceDevice_Remote::setConstraintLinePoint(vrpn_float32 point[3]) {
  std::copy(point, point + 3, constraintLinePoint_);
  updateConstraint();
}
void vrpn_ForceDevice_Remote::setConstraintLineDirection(vrpn_float32 direction[3]) {
  std::copy(direction, direction + 3, constraintLineDirection_);
  updateConstraint();
}
void vrpn_ForceDevice_Remote::setConstraintPlanePoint(vrpn_float32 point[3]) {
  std::copy(point, point + 3, constraintPlanePoint_);
  updateConstraint();
}
void vrpn_ForceDevice_Remote::setConstraintPlaneNormal(vrpn_float32 normal[3]) {
  std::copy(normal, normal + 3, constraintPlaneNormal_);
  updateConstraint();
}
void vrpn_ForceDevice_Remote::setConstraintKSpring(vrpn_float32 k) {
  constraintStiffness_ = k;
  updateConstraint();
}

// --- custom effect

void vrpn_ForceDevice_Remote::startEffect() {
  send(wire::CustomEffect{static_cast<std::uint32_t>(customEffectId), {customEffectParams}});
}
void vrpn_ForceDevice_Remote::stopEffect() {
  send(wire::CustomEffect{wire::kStopCustomEffect, {}});
}

// --- University of Malaga

void vrpn_ForceDevice_Remote::setEffect(const vrpn_int8* type, vrpn_int32 index, vrpn_float64 gain,
                                        vrpn_float64 magnitude, vrpn_float64 duration, vrpn_float64 frequency,
                                        const vrpn_float64 position[3], const vrpn_float64 direction[3]) {
  send(wire::Effect{type, index, gain, magnitude, duration, frequency, arrayOf<3>(position),
                    arrayOf<3>(direction)});
}
void vrpn_ForceDevice_Remote::startEffect(vrpn_int32 index) {
  send(wire::StartEffect{index});
}
void vrpn_ForceDevice_Remote::stopEffect(vrpn_int32 index) {
  send(wire::StopEffect{index});
}
void vrpn_ForceDevice_Remote::resetScene() {
  send(wire::ResetScene{});
}
void vrpn_ForceDevice_Remote::setTransformMatrix(vrpn_int32 object, const vrpn_float64 column_major[16]) {
  send(wire::SetTransformMatrix{object, arrayOf<16>(column_major)});
}
void vrpn_ForceDevice_Remote::setHapticProperty(vrpn_int32 object, const char* name, vrpn_float32 value) {
  send(wire::SetHapticProperty{object, name, value});
}
void vrpn_ForceDevice_Remote::setObjectNumber(vrpn_int32 count) {
  send(wire::SetObjectNumber{count});
}
void vrpn_ForceDevice_Remote::setWorkspaceProjectionMatrix(const vrpn_float64 model[16],
                                                           const vrpn_float64 projection[16]) {
  send(wire::SetWorkspaceProjectionMatrix{arrayOf<16>(model), arrayOf<16>(projection)});
}
void vrpn_ForceDevice_Remote::setWorkspaceBoundingBox(const vrpn_float64 model[16],
                                                      const vrpn_float64 box[6]) {
  send(wire::SetWorkspaceBoundingBox{arrayOf<16>(model), arrayOf<6>(box)});
}
void vrpn_ForceDevice_Remote::setTouchableFace(vrpn_int32 face) {
  send(wire::SetTouchableFace{face});
}
