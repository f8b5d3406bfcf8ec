// Dials without an end stop.
#ifndef VRPN_DIAL_H
#define VRPN_DIAL_H

#include "vrpn_BaseClass.h"

const int vrpn_DIAL_MAX = 128;

typedef struct _vrpn_DIALCB {
  struct timeval msg_time;
  vrpn_int32 dial;
  vrpn_float64 change;
} vrpn_DIALCB;
typedef void(VRPN_CALLBACK* vrpn_DIALCHANGEHANDLER)(void* userdata, const vrpn_DIALCB info);

class VRPN_API vrpn_Dial : public vrpn_BaseClass {
 public:
  vrpn_Dial(const char* name, vrpn_Connection* connection = NULL) : vrpn_BaseClass(name, connection) {}
};

class VRPN_API vrpn_Dial_Remote : public vrpn_Dial {
 public:
  vrpn_Dial_Remote(const char* name, vrpn_Connection* connection = NULL);

  virtual void mainloop() { client_mainloop(); }
  virtual int register_change_handler(void* userdata, vrpn_DIALCHANGEHANDLER handler) {
    return changes_.register_handler(userdata, handler);
  }
  virtual int unregister_change_handler(void* userdata, vrpn_DIALCHANGEHANDLER handler) {
    return changes_.unregister_handler(userdata, handler);
  }

 private:
  static int VRPN_CALLBACK handleChange(void* self, vrpn_HANDLERPARAM p);
  vrpn_Callback_List<vrpn_DIALCB> changes_;
};

#endif
