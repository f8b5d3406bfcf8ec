// What servers of force devices do: encode reports, decode commands, call the derived class.
#include "hapticd/vrpn/vrpn_ForceDeviceServer.h"

#include <string>

#include "client/vrpn/messages.h"

namespace wire = hapticd::wire;
using hapticd::client::arrayOf;
using hapticd::client::receiveMessage;
using hapticd::client::writePayload;

namespace {

template <wire::WireMessage M>
char* encoded(vrpn_int32& length, const M& message) {
  char* payload = new char[wire::payloadSize(message)];
  length = writePayload(message, payload);
  return payload;
}

// Calls use(message); -1 for a damaged payload.
template <wire::WireMessage M, class Use>
vrpn_int32 decoded(const char* buffer, vrpn_int32 length, Use&& use) {
  if (length < 0) return -1;
  const auto message = wire::decode<M>(
      wire::ByteView(reinterpret_cast<const std::byte*>(buffer), static_cast<std::size_t>(length)));
  if (!message) return -1;
  use(*message);
  return 0;
}

}  // namespace

char* vrpn_ForceDevice::encode_force(vrpn_int32& length, const vrpn_float64* force_N) {
  return encoded(length, wire::Force{arrayOf<3>(force_N)});
}
char* vrpn_ForceDevice::encode_scp(vrpn_int32& length, const vrpn_float64* position,
                                   const vrpn_float64* quaternion) {
  return encoded(length, wire::Scp{arrayOf<3>(position), arrayOf<4>(quaternion)});
}
char* vrpn_ForceDevice::encode_error(vrpn_int32& length, vrpn_int32 code) {
  return encoded(length, wire::ForceError{code});
}

vrpn_int32 vrpn_ForceDevice::decode_force(const char* buffer, vrpn_int32 length, vrpn_float64* force_N) {
  return decoded<wire::Force>(buffer, length,
                              [&](const auto& m) { std::copy(m.force.begin(), m.force.end(), force_N); });
}
vrpn_int32 vrpn_ForceDevice::decode_scp(const char* buffer, vrpn_int32 length, vrpn_float64* position,
                                        vrpn_float64* quaternion) {
  return decoded<wire::Scp>(buffer, length, [&](const auto& m) {
    std::copy(m.position.begin(), m.position.end(), position);
    std::copy(m.orientation.begin(), m.orientation.end(), quaternion);
  });
}
vrpn_int32 vrpn_ForceDevice::decode_error(const char* buffer, vrpn_int32 length, vrpn_int32* code) {
  return decoded<wire::ForceError>(buffer, length, [&](const auto& m) { *code = m.code; });
}
vrpn_int32 vrpn_ForceDevice::decode_plane(const char* buffer, vrpn_int32 length, vrpn_float32* plane,
                                          vrpn_float32* kspring, vrpn_float32* kdamp, vrpn_float32* fdyn,
                                          vrpn_float32* fstat, vrpn_int32* index,
                                          vrpn_int32* recoveryCycles) {
  return decoded<wire::Plane>(buffer, length, [&](const auto& m) {
    std::copy(m.plane.begin(), m.plane.end(), plane);
    *kspring = m.stiffness;
    *kdamp = m.damping;
    *fdyn = m.dynamicFriction;
    *fstat = m.staticFriction;
    *index = m.index;
    *recoveryCycles = m.recoveryCycles;
  });
}
vrpn_int32 vrpn_ForceDevice::decode_surface_effects(
    const char* buffer, vrpn_int32 length, vrpn_float32* adhesion_normal, vrpn_float32* adhesion_lateral,
    vrpn_float32* textureAmplitude, vrpn_float32* textureWavelength, vrpn_float32* buzzAmplitude,
    vrpn_float32* buzzFrequency) {
  return decoded<wire::Plane2>(buffer, length, [&](const auto& m) {
    *adhesion_normal = m.normalAdhesion;
    *adhesion_lateral = m.lateralAdhesion;
    *textureAmplitude = m.textureAmplitude;
    *textureWavelength = m.textureWavelength;
    *buzzAmplitude = m.buzzAmplitude;
    *buzzFrequency = m.buzzFrequency;
  });
}
vrpn_int32 vrpn_ForceDevice::decode_forcefield(const char* buffer, vrpn_int32 length, vrpn_float32 origin[3],
                                               vrpn_float32 force[3], vrpn_float32 jacobian[3][3],
                                               vrpn_float32* radius) {
  return decoded<wire::ForceField>(buffer, length, [&](const auto& m) {
    std::copy(m.origin.begin(), m.origin.end(), origin);
    std::copy(m.force.begin(), m.force.end(), force);
    std::copy(m.jacobian.begin(), m.jacobian.end(), &jacobian[0][0]);
    *radius = m.radius;
  });
}
vrpn_int32 vrpn_ForceDevice::decode_custom_effect(const char* buffer, vrpn_int32 length, vrpn_uint32* effect,
                                                  vrpn_float32** parameters, vrpn_uint32* count) {
  return decoded<wire::CustomEffect>(buffer, length, [&](const auto& m) {
    *effect = m.effect;
    *count = static_cast<vrpn_uint32>(m.parameters.values.size());
    delete[] * parameters;
    *parameters = new vrpn_float32[m.parameters.values.size()];
    std::copy(m.parameters.values.begin(), m.parameters.values.end(), *parameters);
  });
}

// The function of the derived class for each message.
struct vrpn_ForceDeviceServer::Calls {
  using Server = vrpn_ForceDeviceServer;
  static bool call(Server& s, const wire::AddObject& m) { return s.addObject(m.object, m.parent); }
  static bool call(Server& s, const wire::AddObjectExScene& m) { return s.addObjectExScene(m.object); }
  static bool call(Server& s, const wire::MoveToParent& m) { return s.moveToParent(m.object, m.parent); }
  static bool call(Server& s, wire::SetObjectPosition m) {
    return s.setObjectPosition(m.object, m.position.data());
  }
  static bool call(Server& s, wire::SetObjectOrientation m) {
    return s.setObjectOrientation(m.object, m.axis.data(), m.angle);
  }
  static bool call(Server& s, wire::SetObjectScale m) { return s.setObjectScale(m.object, m.scale.data()); }
  static bool call(Server& s, const wire::RemoveObject& m) { return s.removeObject(m.object); }
  static bool call(Server& s, const wire::SetVertex& m) {
    return s.setVertex(m.object, m.vertex, m.position[0], m.position[1], m.position[2]);
  }
  static bool call(Server& s, const wire::SetNormal& m) {
    return s.setNormal(m.object, m.normal, m.direction[0], m.direction[1], m.direction[2]);
  }
  static bool call(Server& s, const wire::SetTriangle& m) {
    return s.setTriangle(m.object, m.triangle, m.vertices[0], m.vertices[1], m.vertices[2], m.normals[0],
                         m.normals[1], m.normals[2]);
  }
  static bool call(Server& s, const wire::RemoveTriangle& m) {
    return s.removeTriangle(m.object, m.triangle);
  }
  // As declared. VRPN's own library passes the last three in another order.
  static bool call(Server& s, const wire::UpdateTrimeshChanges& m) {
    return s.updateTrimeshChanges(m.object, m.stiffness, m.damping, m.dynamicFriction, m.staticFriction);
  }
  static bool call(Server& s, wire::TransformTrimesh m) {
    return s.setTrimeshTransform(m.object, m.matrix.data());
  }
  static bool call(Server& s, const wire::SetTrimeshType& m) { return s.setTrimeshType(m.object, m.type); }
  static bool call(Server& s, const wire::ClearTrimesh& m) { return s.clearTrimesh(m.object); }
  static bool call(Server& s, wire::SetHapticOrigin m) {
    return s.setHapticOrigin(m.position.data(), m.axis.data(), m.angle);
  }
  static bool call(Server& s, const wire::SetHapticScale& m) { return s.setHapticScale(m.scale); }
  static bool call(Server& s, wire::SetSceneOrigin m) {
    return s.setSceneOrigin(m.position.data(), m.axis.data(), m.angle);
  }
  static bool call(Server& s, const wire::SetObjectIsTouchable& m) {
    return s.setObjectIsTouchable(m.object, m.touchable);
  }

  template <class Message>
  static int VRPN_CALLBACK handle(void* self, vrpn_HANDLERPARAM p) {
    return receiveMessage<Message>(p, [&](const Message& m) {
      auto& server = *static_cast<Server*>(self);
      if (call(server, m)) return;
      const std::string text = std::string(Message::kInfo.name) + ": refused by the device";
      server.send_text_message(text.c_str(), p.msg_time, vrpn_TEXT_ERROR);
    });
  }
};

template <class Message>
void vrpn_ForceDeviceServer::onMessage() {
  listen(std::string(Message::kInfo.name).c_str(), &Calls::handle<Message>, this);
}

vrpn_ForceDeviceServer::vrpn_ForceDeviceServer(const char* name, vrpn_Connection* connection)
    : vrpn_ForceDevice(name, connection) {
  onMessage<wire::AddObject>();
  onMessage<wire::AddObjectExScene>();
  onMessage<wire::MoveToParent>();
  onMessage<wire::SetObjectPosition>();
  onMessage<wire::SetObjectOrientation>();
  onMessage<wire::SetObjectScale>();
  onMessage<wire::RemoveObject>();
  onMessage<wire::SetVertex>();
  onMessage<wire::SetNormal>();
  onMessage<wire::SetTriangle>();
  onMessage<wire::RemoveTriangle>();
  onMessage<wire::UpdateTrimeshChanges>();
  onMessage<wire::TransformTrimesh>();
  onMessage<wire::SetTrimeshType>();
  onMessage<wire::ClearTrimesh>();
  onMessage<wire::SetHapticOrigin>();
  onMessage<wire::SetHapticScale>();
  onMessage<wire::SetSceneOrigin>();
  onMessage<wire::SetObjectIsTouchable>();
}
