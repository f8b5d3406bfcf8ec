// Anything with a mainloop(), behind one type.
#ifndef VRPN_MAINLOOP_OBJECT_H
#define VRPN_MAINLOOP_OBJECT_H

#include <stdexcept>

#include "vrpn_Connection.h"

class vrpn_MainloopObject {
 public:
  struct CannotWrapNullPointerIntoMainloopObject : std::logic_error {
    CannotWrapNullPointerIntoMainloopObject() : std::logic_error("there is no object to wrap") {}
  };

  virtual ~vrpn_MainloopObject() {}
  virtual void mainloop() = 0;
  /// Whether it has no working connection.
  virtual bool broken() = 0;

  /// Takes a device, which it deletes unless `owner` is false, or a reference to a connection.
  template <class T>
  static vrpn_MainloopObject* wrap(T* object, bool owner = true);

  friend bool operator==(const vrpn_MainloopObject& a, const vrpn_MainloopObject& b) {
    return a.contained() == b.contained();
  }
  friend bool operator!=(const vrpn_MainloopObject& a, const vrpn_MainloopObject& b) { return !(a == b); }

 protected:
  vrpn_MainloopObject() {}
  virtual const void* contained() const = 0;
};

namespace hapticd_vrpn_detail {

inline bool isBroken(vrpn_Connection& connection) {
  return !connection.doing_okay();
}
template <class Device>
bool isBroken(Device& device) {
  return device.connectionPtr() == NULL;
}
inline void release(vrpn_Connection* connection) {
  connection->removeReference();
}
template <class Device>
void release(Device* device) {
  delete device;
}

template <class T>
class Wrapped : public vrpn_MainloopObject {
 public:
  Wrapped(T* object, bool owner) : object_(object), owner_(owner) {
    if (object == NULL) throw CannotWrapNullPointerIntoMainloopObject();
  }
  Wrapped(const Wrapped&) = delete;
  Wrapped& operator=(const Wrapped&) = delete;
  ~Wrapped() {
    if (owner_) release(object_);
  }
  virtual void mainloop() { object_->mainloop(); }
  virtual bool broken() { return isBroken(*object_); }

 protected:
  virtual const void* contained() const { return object_; }

 private:
  T* object_;
  bool owner_;
};

}  // namespace hapticd_vrpn_detail

template <class T>
vrpn_MainloopObject* vrpn_MainloopObject::wrap(T* object, bool owner) {
  return new hapticd_vrpn_detail::Wrapped<T>(object, owner);
}

#endif
