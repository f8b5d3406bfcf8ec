// Messages of one connection, repeated on another.
#ifndef VRPN_FORWARDER_H
#define VRPN_FORWARDER_H

#include <list>

#include "vrpn_Connection.h"

/// Forwards types of messages of named devices, under other names if wanted. The program runs both
/// connections.
class vrpn_ConnectionForwarder {
 public:
  vrpn_ConnectionForwarder(vrpn_Connection* source, vrpn_Connection* destination)
      : source_(source), destination_(destination) {}
  ~vrpn_ConnectionForwarder() {
    while (!routes_.empty()) remove(routes_.begin());
  }
  vrpn_ConnectionForwarder(const vrpn_ConnectionForwarder&) = delete;
  vrpn_ConnectionForwarder& operator=(const vrpn_ConnectionForwarder&) = delete;

  int forward(const char* type, const char* device, const char* new_type, const char* new_device,
              vrpn_uint32 class_of_service = vrpn_CONNECTION_RELIABLE) {
    routes_.push_back(route(type, device, new_type, new_device, class_of_service));
    const Route& added = routes_.back();
    return source_->register_handler(added.type, repeat, &routes_.back(), added.sender);
  }
  /// -1 when this is not forwarded.
  int unforward(const char* type, const char* device, const char* new_type, const char* new_device,
                vrpn_uint32 class_of_service = vrpn_CONNECTION_RELIABLE) {
    const Route unwanted = route(type, device, new_type, new_device, class_of_service);
    for (std::list<Route>::iterator r = routes_.begin(); r != routes_.end(); ++r) {
      if (r->type == unwanted.type && r->sender == unwanted.sender && r->newType == unwanted.newType &&
          r->newSender == unwanted.newSender && r->classOfService == unwanted.classOfService) {
        remove(r);
        return 0;
      }
    }
    return -1;
  }

 private:
  struct Route {
    vrpn_int32 type, sender, newType, newSender;
    vrpn_uint32 classOfService;
    vrpn_Connection* destination;
  };

  Route route(const char* type, const char* device, const char* new_type, const char* new_device,
              vrpn_uint32 class_of_service) {
    const Route made = {source_->register_message_type(type),
                        source_->register_sender(device),
                        destination_->register_message_type(new_type),
                        destination_->register_sender(new_device),
                        class_of_service,
                        destination_};
    return made;
  }
  void remove(std::list<Route>::iterator r) {
    source_->unregister_handler(r->type, repeat, &*r, r->sender);
    routes_.erase(r);
  }
  static int VRPN_CALLBACK repeat(void* self, vrpn_HANDLERPARAM p) {
    const Route& r = *static_cast<const Route*>(self);
    return r.destination->pack_message(static_cast<vrpn_uint32>(p.payload_len), p.msg_time, r.newType,
                                       r.newSender, p.buffer, r.classOfService);
  }

  vrpn_Connection* source_;
  vrpn_Connection* destination_;
  std::list<Route> routes_;
};

/// The same for one device.
class vrpn_StreamForwarder {
 public:
  vrpn_StreamForwarder(vrpn_Connection* source, const char* device, vrpn_Connection* destination,
                       const char* new_device)
      : forwarder_(source, destination), device_(device), newDevice_(new_device) {}

  int forward(const char* type, const char* new_type,
              vrpn_uint32 class_of_service = vrpn_CONNECTION_RELIABLE) {
    return forwarder_.forward(type, device_.c_str(), new_type, newDevice_.c_str(), class_of_service);
  }
  int unforward(const char* type, const char* new_type,
                vrpn_uint32 class_of_service = vrpn_CONNECTION_RELIABLE) {
    return forwarder_.unforward(type, device_.c_str(), new_type, newDevice_.c_str(), class_of_service);
  }

 private:
  vrpn_ConnectionForwarder forwarder_;
  std::string device_, newDevice_;
};

#endif
