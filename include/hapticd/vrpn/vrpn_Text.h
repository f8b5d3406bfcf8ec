// Text messages of a device.
#ifndef VRPN_TEXT_H
#define VRPN_TEXT_H

#include "vrpn_BaseClass.h"

typedef struct _vrpn_TEXTCB {
  struct timeval msg_time;
  char message[vrpn_MAX_TEXT_LEN];
  vrpn_TEXT_SEVERITY type;
  vrpn_uint32 level;
} vrpn_TEXTCB;
typedef void(VRPN_CALLBACK* vrpn_TEXTHANDLER)(void* userdata, const vrpn_TEXTCB info);

const struct timeval vrpn_TEXT_NOW = {0, 0};

/// Serves text messages.
class VRPN_API vrpn_Text_Sender : public vrpn_BaseClass {
 public:
  vrpn_Text_Sender(const char* name, vrpn_Connection* connection = NULL) : vrpn_BaseClass(name, connection) {
    init();
  }
  virtual void mainloop() {
    server_mainloop();
    if (d_connection != NULL) d_connection->mainloop();
  }
  int send_message(const char* text, vrpn_TEXT_SEVERITY severity = vrpn_TEXT_NORMAL, vrpn_uint32 level = 0,
                   const struct timeval time = vrpn_TEXT_NOW);
};

class VRPN_API vrpn_Text_Receiver : public vrpn_BaseClass {
 public:
  vrpn_Text_Receiver(const char* name, vrpn_Connection* connection = NULL);

  virtual void mainloop() { client_mainloop(); }
  virtual int register_message_handler(void* userdata, vrpn_TEXTHANDLER handler) {
    return messages_.register_handler(userdata, handler);
  }
  virtual int unregister_message_handler(void* userdata, vrpn_TEXTHANDLER handler) {
    return messages_.unregister_handler(userdata, handler);
  }

 private:
  static int VRPN_CALLBACK handleMessage(void* self, vrpn_HANDLERPARAM p);
  vrpn_Callback_List<vrpn_TEXTCB> messages_;
};

#endif
