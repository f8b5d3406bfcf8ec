// The server of a force device that has a scene.
#ifndef VRPN_FORCEDEVICE_SERVER_H
#define VRPN_FORCEDEVICE_SERVER_H

#include "vrpn_ForceDevice.h"

/// Calls a function of the derived class for each message about objects and the scene; false is a refusal. A
/// derived class that renders surfaces, force fields or effects without objects registers handlers of its own
/// for forcefield_message_id, plane_message_id, plane_effects_message_id and custom_effect_message_id.
class VRPN_API vrpn_ForceDeviceServer : public vrpn_ForceDevice {
 public:
  vrpn_ForceDeviceServer(const char* name, vrpn_Connection* connection);

 protected:
  virtual bool addObject(vrpn_int32 object, vrpn_int32 parent = -1) = 0;
  virtual bool addObjectExScene(vrpn_int32 object) = 0;
  virtual bool setVertex(vrpn_int32 object, vrpn_int32 vertex, vrpn_float32 x, vrpn_float32 y,
                         vrpn_float32 z) = 0;
  virtual bool setNormal(vrpn_int32 object, vrpn_int32 normal, vrpn_float32 x, vrpn_float32 y,
                         vrpn_float32 z) = 0;
  virtual bool setTriangle(vrpn_int32 object, vrpn_int32 triangle, vrpn_int32 v0, vrpn_int32 v1,
                           vrpn_int32 v2, vrpn_int32 n0 = -1, vrpn_int32 n1 = -1, vrpn_int32 n2 = -1) = 0;
  virtual bool removeTriangle(vrpn_int32 object, vrpn_int32 triangle) = 0;
  virtual bool updateTrimeshChanges(vrpn_int32 object, vrpn_float32 kspring, vrpn_float32 kdamp,
                                    vrpn_float32 fdyn, vrpn_float32 fstat) = 0;
  virtual bool setTrimeshType(vrpn_int32 object, vrpn_int32 type) = 0;
  virtual bool setTrimeshTransform(vrpn_int32 object, vrpn_float32 row_major[16]) = 0;
  virtual bool setObjectPosition(vrpn_int32 object, vrpn_float32 position[3]) = 0;
  virtual bool setObjectOrientation(vrpn_int32 object, vrpn_float32 axis[3], vrpn_float32 angle) = 0;
  virtual bool setObjectScale(vrpn_int32 object, vrpn_float32 scale[3]) = 0;
  virtual bool removeObject(vrpn_int32 object) = 0;
  virtual bool clearTrimesh(vrpn_int32 object) = 0;
  virtual bool moveToParent(vrpn_int32 object, vrpn_int32 parent) = 0;
  virtual bool setHapticOrigin(vrpn_float32 position[3], vrpn_float32 axis[3], vrpn_float32 angle) = 0;
  virtual bool setHapticScale(vrpn_float32 scale) = 0;
  virtual bool setSceneOrigin(vrpn_float32 position[3], vrpn_float32 axis[3], vrpn_float32 angle) = 0;
  virtual bool setObjectIsTouchable(vrpn_int32 object, vrpn_bool touchable = true) = 0;

 private:
  template <class Message>
  void onMessage();
  struct Calls;
};

#endif
