// Values of analog channels.
#ifndef VRPN_ANALOG_H
#define VRPN_ANALOG_H

#include "vrpn_BaseClass.h"

#define vrpn_CHANNEL_MAX 128

typedef struct _vrpn_ANALOGCB {
  struct timeval msg_time;
  vrpn_int32 num_channel;
  vrpn_float64 channel[vrpn_CHANNEL_MAX];
} vrpn_ANALOGCB;
typedef void(VRPN_CALLBACK* vrpn_ANALOGCHANGEHANDLER)(void* userdata, const vrpn_ANALOGCB info);

class VRPN_API vrpn_Analog : public vrpn_BaseClass {
 public:
  vrpn_Analog(const char* name, vrpn_Connection* connection = NULL) : vrpn_BaseClass(name, connection) {}
  vrpn_int32 getNumChannels() const { return num_channel; }

 protected:
  vrpn_float64 channel[vrpn_CHANNEL_MAX] = {};
  vrpn_int32 num_channel = 0;
};

class VRPN_API vrpn_Analog_Remote : public vrpn_Analog {
 public:
  vrpn_Analog_Remote(const char* name, vrpn_Connection* connection = NULL);

  virtual void mainloop() { client_mainloop(); }
  virtual int register_change_handler(void* userdata, vrpn_ANALOGCHANGEHANDLER handler) {
    return changes_.register_handler(userdata, handler);
  }
  virtual int unregister_change_handler(void* userdata, vrpn_ANALOGCHANGEHANDLER handler) {
    return changes_.unregister_handler(userdata, handler);
  }

 private:
  static int VRPN_CALLBACK handleChange(void* self, vrpn_HANDLERPARAM p);
  vrpn_Callback_List<vrpn_ANALOGCB> changes_;
};

#endif
