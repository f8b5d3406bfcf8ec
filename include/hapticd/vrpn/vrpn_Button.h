// Buttons of a device.
#ifndef VRPN_BUTTON_H
#define VRPN_BUTTON_H

#include "vrpn_BaseClass.h"

const int vrpn_BUTTON_MAX_BUTTONS = 256;
const int VRPN_BUTTON_BUF_SIZE = 256;
const int vrpn_BUTTON_MOMENTARY = 10;
const int vrpn_BUTTON_TOGGLE_OFF = 20;
const int vrpn_BUTTON_TOGGLE_ON = 21;
const int vrpn_ALL_ID = -99;
#define VRPN_BUTTON_OFF (0)
#define VRPN_BUTTON_ON (1)

typedef struct _vrpn_BUTTONCB {
  struct timeval msg_time;
  vrpn_int32 button;
  vrpn_int32 state;
} vrpn_BUTTONCB;
typedef void(VRPN_CALLBACK* vrpn_BUTTONCHANGEHANDLER)(void* userdata, const vrpn_BUTTONCB info);

typedef struct _vrpn_BUTTONSTATECB {
  struct timeval msg_time;
  vrpn_int32 num_buttons;
  vrpn_int32 states[vrpn_BUTTON_MAX_BUTTONS];
} vrpn_BUTTONSTATESCB;
typedef void(VRPN_CALLBACK* vrpn_BUTTONSTATESHANDLER)(void* userdata, const vrpn_BUTTONSTATESCB info);

class VRPN_API vrpn_Button : public vrpn_BaseClass {
 public:
  vrpn_Button(const char* name, vrpn_Connection* connection = NULL) : vrpn_BaseClass(name, connection) {}
  virtual void set_momentary(vrpn_int32 button);
  virtual void set_toggle(vrpn_int32 button, vrpn_int32 state);
  virtual void set_all_momentary() { set_momentary(vrpn_ALL_ID); }
  virtual void set_all_toggle(vrpn_int32 state) { set_toggle(vrpn_ALL_ID, state); }
};

class VRPN_API vrpn_Button_Remote : public vrpn_Button {
 public:
  vrpn_Button_Remote(const char* name, vrpn_Connection* connection = NULL);

  virtual void mainloop() { client_mainloop(); }
  virtual int register_change_handler(void* userdata, vrpn_BUTTONCHANGEHANDLER handler) {
    return changes_.register_handler(userdata, handler);
  }
  virtual int unregister_change_handler(void* userdata, vrpn_BUTTONCHANGEHANDLER handler) {
    return changes_.unregister_handler(userdata, handler);
  }
  virtual int register_states_handler(void* userdata, vrpn_BUTTONSTATESHANDLER handler) {
    return states_.register_handler(userdata, handler);
  }
  virtual int unregister_states_handler(void* userdata, vrpn_BUTTONSTATESHANDLER handler) {
    return states_.unregister_handler(userdata, handler);
  }

 private:
  static int VRPN_CALLBACK handleChange(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleStates(void* self, vrpn_HANDLERPARAM p);
  vrpn_Callback_List<vrpn_BUTTONCB> changes_;
  vrpn_Callback_List<vrpn_BUTTONSTATESCB> states_;
};

#endif
