// A haptic device: stock VRPN's calls, and those of the University of Malaga's server (Effect and below).
#ifndef FORCEDEVICE_H
#define FORCEDEVICE_H

#include <vector>

#include "vrpn_BaseClass.h"

#define MAXPLANE 4
#define DEFAULT_NUM_REC_CYCLES (10)
#define FD_VALUE_OUT_OF_RANGE 0
#define FD_DUTY_CYCLE_ERROR 1
#define FD_FORCE_ERROR 2
#define FD_MISC_ERROR 3
#define FD_OK 4

typedef struct _vrpn_FORCECB {
  struct timeval msg_time;
  vrpn_float64 force[3];
} vrpn_FORCECB;
typedef void(VRPN_CALLBACK* vrpn_FORCECHANGEHANDLER)(void* userdata, const vrpn_FORCECB info);

typedef struct _vrpn_FORCESCPCB {
  struct timeval msg_time;
  vrpn_float64 pos[3];
  vrpn_float64 quat[4];
} vrpn_FORCESCPCB;
typedef void(VRPN_CALLBACK* vrpn_FORCESCPHANDLER)(void* userdata, const vrpn_FORCESCPCB info);

typedef struct _vrpn_FORCEERRORCB {
  struct timeval msg_time;
  vrpn_int32 error_code;
} vrpn_FORCEERRORCB;
typedef void(VRPN_CALLBACK* vrpn_FORCEERRORHANDLER)(void* userdata, const vrpn_FORCEERRORCB info);

typedef struct _vrpn_DOPCB {
  struct timeval msg_time;
  vrpn_float64 dop;
} vrpn_DOPCB;
typedef void(VRPN_CALLBACK* vrpn_DOPHANDLER)(void* userdata, const vrpn_DOPCB info);

typedef struct _vrpn_ISTOUCHINGCB {
  struct timeval msg_time;
  vrpn_bool isTouching;
} vrpn_ISTOUCHINGCB;
typedef void(VRPN_CALLBACK* vrpn_ISTOUCHINGHANDLER)(void* userdata, const vrpn_ISTOUCHINGCB info);

typedef struct _vrpn_TOUCHEDOBJECTCB {
  struct timeval msg_time;
  vrpn_int32 ObjectNum;
} vrpn_TOUCHEDOBJECTCB;
typedef void(VRPN_CALLBACK* vrpn_TOUCHEDOBJECTHANDLER)(void* userdata, const vrpn_TOUCHEDOBJECTCB info);

typedef struct _vrpn_ANGLECB {
  struct timeval msg_time;
  vrpn_float64 angle;
  vrpn_bool isTouching;
} vrpn_ANGLECB;
typedef void(VRPN_CALLBACK* vrpn_ANGLEHANDLER)(void* userdata, const vrpn_ANGLECB info);

/// Surface, force field and custom effect of the device, as set before they are sent.
class VRPN_API vrpn_ForceDevice : public vrpn_BaseClass {
 public:
  vrpn_ForceDevice(const char* name, vrpn_Connection* connection = NULL);

  void print_report();
  void print_plane();
  /// For servers: reports a fault, one of the FD_ codes.
  void sendError(int code);

  enum ConstraintGeometry { NO_CONSTRAINT, POINT_CONSTRAINT, LINE_CONSTRAINT, PLANE_CONSTRAINT };

  void setSurfaceKspring(vrpn_float32 k) { SurfaceKspring = k; }
  void setSurfaceKdamping(vrpn_float32 d) { SurfaceKdamping = d; }
  void setSurfaceFstatic(vrpn_float32 f) { SurfaceFstatic = f; }
  void setSurfaceFdynamic(vrpn_float32 f) { SurfaceFdynamic = f; }
  void setRecoveryTime(int cycles) { numRecCycles = cycles; }
  int getRecoveryTime() { return numRecCycles; }
  void setSurfaceKadhesionNormal(vrpn_float32 k) { SurfaceKadhesionNormal = k; }
  void setSurfaceKadhesionLateral(vrpn_float32 k) { SurfaceKadhesionLateral = k; }
  void setSurfaceBuzzFrequency(vrpn_float32 frequency) { SurfaceBuzzFreq = frequency; }
  void setSurfaceBuzzAmplitude(vrpn_float32 amplitude) { SurfaceBuzzAmp = amplitude; }
  void setSurfaceTextureWavelength(vrpn_float32 wavelength) { SurfaceTextureWavelength = wavelength; }
  void setSurfaceTextureAmplitude(vrpn_float32 amplitude) { SurfaceTextureAmplitude = amplitude; }
  void setCustomEffect(vrpn_int32 effect, vrpn_float32* parameters = NULL, vrpn_uint32 count = 0);
  void setFF_Origin(vrpn_float32 x, vrpn_float32 y, vrpn_float32 z);
  void setFF_Origin(vrpn_float32 x[3]) { setFF_Origin(x[0], x[1], x[2]); }
  void setFF_Force(vrpn_float32 x, vrpn_float32 y, vrpn_float32 z);
  void setFF_Force(vrpn_float32 f[3]) { setFF_Force(f[0], f[1], f[2]); }
  void setFF_Jacobian(vrpn_float32 xx, vrpn_float32 xy, vrpn_float32 xz, vrpn_float32 yx, vrpn_float32 yy,
                      vrpn_float32 yz, vrpn_float32 zx, vrpn_float32 zy, vrpn_float32 zz);
  void setFF_Radius(vrpn_float32 radius) { ff_radius = radius; }
  void set_plane(vrpn_float32* p) { set_plane(p[0], p[1], p[2], p[3]); }
  void set_plane(vrpn_float32* normal, vrpn_float32 d) { set_plane(normal[0], normal[1], normal[2], d); }
  void set_plane(vrpn_float32 a, vrpn_float32 b, vrpn_float32 c, vrpn_float32 d);
  int connectionAvailable() { return d_connection != NULL; }

 protected:
  virtual int register_types();

  // For servers. The caller releases an encoded payload by delete[]; decoding returns -1 for a damaged one.
  static char* encode_force(vrpn_int32& length, const vrpn_float64* force_N);
  static char* encode_scp(vrpn_int32& length, const vrpn_float64* position, const vrpn_float64* quaternion);
  static char* encode_error(vrpn_int32& length, vrpn_int32 code);
  static vrpn_int32 decode_force(const char* buffer, vrpn_int32 length, vrpn_float64* force_N);
  static vrpn_int32 decode_scp(const char* buffer, vrpn_int32 length, vrpn_float64* position,
                               vrpn_float64* quaternion);
  static vrpn_int32 decode_error(const char* buffer, vrpn_int32 length, vrpn_int32* code);
  static vrpn_int32 decode_plane(const char* buffer, vrpn_int32 length, vrpn_float32* plane,
                                 vrpn_float32* kspring, vrpn_float32* kdamp, vrpn_float32* fdyn,
                                 vrpn_float32* fstat, vrpn_int32* index, vrpn_int32* recovery_cycles);
  static vrpn_int32 decode_surface_effects(const char* buffer, vrpn_int32 length,
                                           vrpn_float32* adhesion_normal, vrpn_float32* adhesion_lateral,
                                           vrpn_float32* texture_amplitude, vrpn_float32* texture_wavelength,
                                           vrpn_float32* buzz_amplitude, vrpn_float32* buzz_frequency);
  static vrpn_int32 decode_forcefield(const char* buffer, vrpn_int32 length, vrpn_float32 origin[3],
                                      vrpn_float32 force[3], vrpn_float32 jacobian[3][3],
                                      vrpn_float32* radius);
  /// *parameters must be allocated by new[] or NULL; it is replaced.
  static vrpn_int32 decode_custom_effect(const char* buffer, vrpn_int32 length, vrpn_uint32* effect,
                                         vrpn_float32** parameters, vrpn_uint32* count);

  vrpn_int32 force_message_id = -1;
  vrpn_int32 scp_message_id = -1;
  vrpn_int32 error_message_id = -1;
  vrpn_int32 plane_message_id = -1;
  vrpn_int32 plane_effects_message_id = -1;
  vrpn_int32 forcefield_message_id = -1;
  vrpn_int32 custom_effect_message_id = -1;
  vrpn_int32 addObject_message_id = -1;
  vrpn_int32 addObjectExScene_message_id = -1;
  vrpn_int32 moveToParent_message_id = -1;
  vrpn_int32 setObjectPosition_message_id = -1;
  vrpn_int32 setObjectOrientation_message_id = -1;
  vrpn_int32 setObjectScale_message_id = -1;
  vrpn_int32 removeObject_message_id = -1;
  vrpn_int32 setVertex_message_id = -1;
  vrpn_int32 setNormal_message_id = -1;
  vrpn_int32 setTriangle_message_id = -1;
  vrpn_int32 removeTriangle_message_id = -1;
  vrpn_int32 updateTrimeshChanges_message_id = -1;
  vrpn_int32 transformTrimesh_message_id = -1;
  vrpn_int32 setTrimeshType_message_id = -1;
  vrpn_int32 clearTrimesh_message_id = -1;
  vrpn_int32 setHapticOrigin_message_id = -1;
  vrpn_int32 setHapticScale_message_id = -1;
  vrpn_int32 setSceneOrigin_message_id = -1;
  vrpn_int32 getNewObjectID_message_id = -1;
  vrpn_int32 setObjectIsTouchable_message_id = -1;
  vrpn_int32 enableConstraint_message_id = -1;
  vrpn_int32 setConstraintMode_message_id = -1;
  vrpn_int32 setConstraintPoint_message_id = -1;
  vrpn_int32 setConstraintLinePoint_message_id = -1;
  vrpn_int32 setConstraintLineDirection_message_id = -1;
  vrpn_int32 setConstraintPlanePoint_message_id = -1;
  vrpn_int32 setConstraintPlaneNormal_message_id = -1;
  vrpn_int32 setConstraintKSpring_message_id = -1;

  struct timeval timestamp = {};
  vrpn_int32 errorCode = FD_OK;
  // The last report, N and m.
  vrpn_float64 force[3] = {};
  vrpn_float64 scp_pos[3] = {};
  vrpn_float64 scp_quat[4] = {0, 0, 0, 1};

  vrpn_int32 which_plane = 0;
  vrpn_float32 plane[4] = {};
  vrpn_float32 ff_origin[3] = {};
  vrpn_float32 ff_force[3] = {};
  vrpn_float32 ff_jacobian[3][3] = {};
  vrpn_float32 ff_radius = 0;
  vrpn_float32 SurfaceKspring = 0.8f;
  vrpn_float32 SurfaceKdamping = 0.001f;
  vrpn_float32 SurfaceFstatic = 0.7f;
  vrpn_float32 SurfaceFdynamic = 0.3f;
  vrpn_int32 numRecCycles = 1;
  vrpn_float32 SurfaceKadhesionLateral = 0.0002f;
  vrpn_float32 SurfaceKadhesionNormal = 0.0001f;
  vrpn_float32 SurfaceBuzzFreq = 0.0003f;
  vrpn_float32 SurfaceBuzzAmp = 0.0004f;
  vrpn_float32 SurfaceTextureWavelength = 0.01f;
  vrpn_float32 SurfaceTextureAmplitude = 0.0005f;
  vrpn_int32 customEffectId = -1;
  std::vector<vrpn_float32> customEffectParams;
};

class VRPN_API vrpn_ForceDevice_Remote : public vrpn_ForceDevice {
 public:
  vrpn_ForceDevice_Remote(const char* name, vrpn_Connection* connection = NULL);

  virtual void mainloop() { client_mainloop(); }

  // The device's own surface.
  void sendSurface();
  void startSurface();
  void stopSurface();

  // Object 0.
  void setVertex(vrpn_int32 vertex, vrpn_float32 x, vrpn_float32 y, vrpn_float32 z) {
    setObjectVertex(0, vertex, x, y, z);
  }
  void setNormal(vrpn_int32 normal, vrpn_float32 x, vrpn_float32 y, vrpn_float32 z) {
    setObjectNormal(0, normal, x, y, z);
  }
  void setTriangle(vrpn_int32 triangle, vrpn_int32 v0, vrpn_int32 v1, vrpn_int32 v2, vrpn_int32 n0 = -1,
                   vrpn_int32 n1 = -1, vrpn_int32 n2 = -1) {
    setObjectTriangle(0, triangle, v0, v1, v2, n0, n1, n2);
  }
  void removeTriangle(vrpn_int32 triangle) { removeObjectTriangle(0, triangle); }
  void updateTrimeshChanges() { updateObjectTrimeshChanges(0); }
  void setTrimeshTransform(vrpn_float32 row_major[16]) { setObjectTrimeshTransform(0, row_major); }
  void clearTrimesh() { clearObjectTrimesh(0); }

  // Any object.
  void addObject(vrpn_int32 object, vrpn_int32 parent = -1);
  void addObjectExScene(vrpn_int32 object);
  void setObjectVertex(vrpn_int32 object, vrpn_int32 vertex, vrpn_float32 x, vrpn_float32 y, vrpn_float32 z);
  void setObjectNormal(vrpn_int32 object, vrpn_int32 normal, vrpn_float32 x, vrpn_float32 y, vrpn_float32 z);
  void setObjectTriangle(vrpn_int32 object, vrpn_int32 triangle, vrpn_int32 v0, vrpn_int32 v1, vrpn_int32 v2,
                         vrpn_int32 n0 = -1, vrpn_int32 n1 = -1, vrpn_int32 n2 = -1);
  void removeObjectTriangle(vrpn_int32 object, vrpn_int32 triangle);
  void updateObjectTrimeshChanges(vrpn_int32 object);
  void setObjectTrimeshTransform(vrpn_int32 object, vrpn_float32 row_major[16]);
  void setObjectPosition(vrpn_int32 object, vrpn_float32 position[3]);
  void setObjectOrientation(vrpn_int32 object, vrpn_float32 axis[3], vrpn_float32 angle);
  void setObjectScale(vrpn_int32 object, vrpn_float32 scale[3]);
  void removeObject(vrpn_int32 object);
  void clearObjectTrimesh(vrpn_int32 object);

  // The scene.
  void moveToParent(vrpn_int32 object, vrpn_int32 parent);
  void setHapticOrigin(vrpn_float32 position[3], vrpn_float32 axis[3], vrpn_float32 angle);
  void setHapticScale(vrpn_float32 scale);
  void setSceneOrigin(vrpn_float32 position[3], vrpn_float32 axis[3], vrpn_float32 angle);
  /// A number above those of all objects that were added here.
  vrpn_int32 getNewObjectID() { return nextObjectId_++; }
  void setObjectIsTouchable(vrpn_int32 object, vrpn_bool touchable = true);
  void setObjectTouchable(vrpn_int32 object, vrpn_bool touchable = true) {
    setObjectIsTouchable(object, touchable);
  }
  void useHcollide();
  void useGhost();

  // Constraints are sent as force fields, so that only one of the two can be active.
  void enableConstraint(vrpn_int32 enable);
  void setConstraintMode(ConstraintGeometry mode);
  void setConstraintPoint(vrpn_float32 point[3]);
  void setConstraintLinePoint(vrpn_float32 point[3]);
  void setConstraintLineDirection(vrpn_float32 direction[3]);
  void setConstraintPlanePoint(vrpn_float32 point[3]);
  void setConstraintPlaneNormal(vrpn_float32 normal[3]);
  void setConstraintKSpring(vrpn_float32 k);
  void sendForceField(vrpn_float32 origin[3], vrpn_float32 strength[3], vrpn_float32 jacobian[3][3],
                      vrpn_float32 radius);
  void sendForceField();
  void stopForceField();

  // The custom effect.
  void startEffect();
  void stopEffect();

  // University of Malaga.
  void setEffect(const vrpn_int8* type, vrpn_int32 index, vrpn_float64 gain, vrpn_float64 magnitude,
                 vrpn_float64 duration, vrpn_float64 frequency, const vrpn_float64 position[3],
                 const vrpn_float64 direction[3]);
  void startEffect(vrpn_int32 index);
  void stopEffect(vrpn_int32 index);
  void resetScene();
  void setTransformMatrix(vrpn_int32 object, const vrpn_float64 column_major[16]);
  void setHapticProperty(vrpn_int32 object, const char* name, vrpn_float32 value);
  void setObjectNumber(vrpn_int32 count);
  void setWorkspaceProjectionMatrix(const vrpn_float64 model[16], const vrpn_float64 projection[16]);
  void setWorkspaceBoundingBox(const vrpn_float64 model[16], const vrpn_float64 box[6]);
  void setTouchableFace(vrpn_int32 face = 3);

#define HAPTICD_VRPN_HANDLERS(name, HANDLER, list)                 \
  virtual int register_##name(void* userdata, HANDLER handler) {   \
    return list.register_handler(userdata, handler);               \
  }                                                                \
  virtual int unregister_##name(void* userdata, HANDLER handler) { \
    return list.unregister_handler(userdata, handler);             \
  }
  HAPTICD_VRPN_HANDLERS(force_change_handler, vrpn_FORCECHANGEHANDLER, forces_)
  HAPTICD_VRPN_HANDLERS(scp_change_handler, vrpn_FORCESCPHANDLER, scps_)
  HAPTICD_VRPN_HANDLERS(error_handler, vrpn_FORCEERRORHANDLER, errors_)
  HAPTICD_VRPN_HANDLERS(dop_change_handler, vrpn_DOPHANDLER, dops_)
  HAPTICD_VRPN_HANDLERS(isTouching_handler, vrpn_ISTOUCHINGHANDLER, touchings_)
  HAPTICD_VRPN_HANDLERS(touchedObject_handler, vrpn_TOUCHEDOBJECTHANDLER, objects_)
  HAPTICD_VRPN_HANDLERS(angle_handler, vrpn_ANGLEHANDLER, angles_)
#undef HAPTICD_VRPN_HANDLERS

 private:
  template <class Message>
  void send(const Message& message);
  void sendField(bool reliably);
  void sendPlane(bool reliably);
  void reserve(vrpn_int32 object);
  void updateConstraint();
  static int VRPN_CALLBACK handleForce(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleScp(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleError(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleDop(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleTouching(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleObject(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleAngle(void* self, vrpn_HANDLERPARAM p);

  vrpn_Callback_List<vrpn_FORCECB> forces_;
  vrpn_Callback_List<vrpn_FORCESCPCB> scps_;
  vrpn_Callback_List<vrpn_FORCEERRORCB> errors_;
  vrpn_Callback_List<vrpn_DOPCB> dops_;
  vrpn_Callback_List<vrpn_ISTOUCHINGCB> touchings_;
  vrpn_Callback_List<vrpn_TOUCHEDOBJECTCB> objects_;
  vrpn_Callback_List<vrpn_ANGLECB> angles_;
  vrpn_int32 nextObjectId_ = 1;
  bool constrained_ = false;
  ConstraintGeometry constraintMode_ = POINT_CONSTRAINT;
  vrpn_float32 constraintPoint_[3] = {};
  vrpn_float32 constraintLinePoint_[3] = {};
  vrpn_float32 constraintLineDirection_[3] = {};
  vrpn_float32 constraintPlanePoint_[3] = {};
  vrpn_float32 constraintPlaneNormal_[3] = {};
  vrpn_float32 constraintStiffness_ = 0;
};

#endif
