// Devices and connections whose mainloop() runs together.
#ifndef VRPN_MAINLOOP_CONTAINER_H
#define VRPN_MAINLOOP_CONTAINER_H

#include <memory>
#include <vector>

#include "vrpn_MainloopObject.h"

/// Owns what is added and deletes it in reverse order.
class vrpn_MainloopContainer {
 public:
  vrpn_MainloopContainer() {}
  ~vrpn_MainloopContainer() { clear(); }
  vrpn_MainloopContainer(const vrpn_MainloopContainer&) = delete;
  vrpn_MainloopContainer& operator=(const vrpn_MainloopContainer&) = delete;

  void clear() {
    while (!objects_.empty()) objects_.pop_back();
  }
  /// NULL, and the caller keeps the object, when it is broken.
  vrpn_MainloopObject* add(vrpn_MainloopObject* object) {
    if (object == NULL || object->broken()) return NULL;
    objects_.emplace_back(object);
    return object;
  }
  template <class T>
  T* add(T* object) {
    std::unique_ptr<vrpn_MainloopObject> wrapped(vrpn_MainloopObject::wrap(object));
    if (add(wrapped.get()) == NULL) return NULL;
    wrapped.release();
    return object;
  }
  void mainloop() {
    for (size_t i = 0; i < objects_.size(); ++i) objects_[i]->mainloop();
  }

 private:
  std::vector<std::unique_ptr<vrpn_MainloopObject>> objects_;
};

#endif
