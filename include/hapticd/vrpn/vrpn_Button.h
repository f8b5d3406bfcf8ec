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
  vrpn_Button(const char* name, vrpn_Connection* connection = NULL);
  void print();
  virtual void set_momentary(vrpn_int32 button);
  virtual void set_toggle(vrpn_int32 button, vrpn_int32 state);
  virtual void set_all_momentary() { set_momentary(vrpn_ALL_ID); }
  virtual void set_all_toggle(vrpn_int32 state) { set_toggle(vrpn_ALL_ID, state); }

 protected:
  virtual int register_types();
  /// Reports each button that differs from what was reported last.
  virtual void report_changes();
  virtual void report_states();
  // Write a payload; return its size.
  virtual vrpn_int32 encode_to(char* buffer, vrpn_int32 button, vrpn_int32 state);
  virtual vrpn_int32 encode_states_to(char* buffer);

  unsigned char buttons[vrpn_BUTTON_MAX_BUTTONS] = {};
  unsigned char lastbuttons[vrpn_BUTTON_MAX_BUTTONS] = {};
  vrpn_int32 minrate[vrpn_BUTTON_MAX_BUTTONS] = {};
  vrpn_int32 num_buttons = 0;
  struct timeval timestamp = {};
  vrpn_int32 change_message_id = -1;
  vrpn_int32 states_message_id = -1;
  vrpn_int32 admin_message_id = -1;
};

/// The base of button servers: buttons can be made toggles, by the program and by clients. All states are
/// reported to each new client and after each ping.
class VRPN_API vrpn_Button_Filter : public vrpn_Button {
 public:
  virtual void set_momentary(vrpn_int32 button);
  virtual void set_toggle(vrpn_int32 button, vrpn_int32 state);
  virtual void set_all_momentary();
  /// What is a toggle already keeps its state.
  virtual void set_all_toggle(vrpn_int32 state);
  /// Whether clients are told when a toggle or its mode changes.
  void set_alerts(vrpn_int32 on) { send_alerts = on; }

  /// vrpn_BUTTON_MOMENTARY, vrpn_BUTTON_TOGGLE_OFF or vrpn_BUTTON_TOGGLE_ON.
  vrpn_int32 buttonstate[vrpn_BUTTON_MAX_BUTTONS];

 protected:
  vrpn_Button_Filter(const char* name, vrpn_Connection* connection = NULL);
  virtual void report_changes();
  virtual vrpn_int32 encode_states_to(char* buffer);

  int send_alerts = 0;
  vrpn_int32 alert_message_id = -1;

 private:
  void alert(vrpn_int32 button, vrpn_int32 event);
  static int VRPN_CALLBACK handleAdmin(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handleNewClient(void* self, vrpn_HANDLERPARAM p);
};

/// Serves buttons that the program sets.
class VRPN_API vrpn_Button_Server : public vrpn_Button_Filter {
 public:
  vrpn_Button_Server(const char* name, vrpn_Connection* connection, int number = 1);
  int number_of_buttons() { return num_buttons; }
  virtual void mainloop();
  /// -1 for a button that the device does not have.
  int set_button(int button, int state);
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
