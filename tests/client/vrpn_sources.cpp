// What programs written for VRPN use, in each standard that they are compiled in. Only compiled, never run.
#include <quat.h>
#include <vrpn_Analog.h>
#include <vrpn_Analog_Output.h>
#include <vrpn_Auxiliary_Logger.h>
#include <vrpn_BaseClass.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_Dial.h>
#include <vrpn_FileConnection.h>
#include <vrpn_FileController.h>
#include <vrpn_ForceDevice.h>
#include <vrpn_ForceDeviceServer.h>
#include <vrpn_Forwarder.h>
#include <vrpn_ForwarderController.h>
#include <vrpn_LamportClock.h>
#include <vrpn_MainloopContainer.h>
#include <vrpn_MainloopObject.h>
#include <vrpn_Mutex.h>
#include <vrpn_Poser.h>
#include <vrpn_RedundantTransmission.h>
#include <vrpn_SendTextMessageStreamProxy.h>
#include <vrpn_Shared.h>
#include <vrpn_SharedObject.h>
#include <vrpn_Text.h>
#include <vrpn_Thread.h>
#include <vrpn_Tracker.h>

#include "vrpn_device.h"

void connections(vrpn_Connection* c) {
  c->Jane_stop_this_crazy_thing(5);
  (void)c->get_File_Connection();
  c->register_log_filter(0, 0);
  c->save_log_so_far();
  vrpn_create_server_connection(3883);
  vrpn_create_server_connection(":3883");
  vrpn_create_server_connection("loopback:");
  vrpn_create_server_connection();
  delete[] vrpn_copy_machine_name("b:3");
  vrpn_get_port_number("b:3");
  delete[] vrpn_copy_file_name("file:x");
  delete[] vrpn_set_service_name("a@b", "c");
  check_vrpn_cookie("x");
  vrpn_cookie_size();
  char b[99];
  write_vrpn_cookie(b, 99, 0);
  (void)vrpn_LOG_NONE;
  (void)vrpn_LOG_INCOMING;
  (void)vrpn_LOG_OUTGOING;
  (void)vrpn_CONNECTION_SENDER_DESCRIPTION;
  (void)vrpn_CONNECTION_DISCONNECT_MESSAGE;
  (void)vrpn_CONNECTION_MAX_TYPES;
  (void)vrpn_MAX_ENDPOINTS;
  (void)vrpn_ALIGN;
  vrpn_ConnectionManager::instance().getByName("x");
  vrpn_Connection_Loopback* l = 0;
  (void)l;
  vrpn_Connection_IP p;
  vrpn_Connection* q = new vrpn_Connection_IP(4000);
  (void)q;
  vrpn_noint_block_write(1, "x", 1);
  vrpn_LOGFILTER h = 0;
  (void)h;
  vrpn_TranslationTable* t = 0;
  (void)t;
}

void files(vrpn_File_Connection* f) {
  vrpn_File_Connection g("file:x");
  f->reset();
  f->set_replay_rate(2.0f);
  (void)f->eof();
  (void)f->get_length_secs();
  f->play_to_time(1.0);
}

void shared() {
  (void)vrpn_htond(1.0);
  (void)vrpn_ntohd(1.0);
  (void)VRPN_INCHES_TO_METERS;
  vrpn_SOCKET s = INVALID_SOCKET;
  (void)s;
  vrpn_vector<char> v(5);
  char b[9];
  vrpn_strncpynull(b, "x", 9);
  const char* p = "12345678";
  vrpn_int32 d = vrpn_unbuffer<vrpn_int32>(p);
  (void)d;
  vrpn_Semaphore semaphore;
  vrpn_Thread* t = 0;
  (void)t;
  unsigned char* u = 0;
  vrpn_int32 n = 0;
  vrpn_buffer(&u, &n, (vrpn_float64)1.0);
  vrpn_test_pack_unpack();
}

class My : public vrpn_Tracker_Remote {
 public:
  My(const char* name, vrpn_Connection* c) : vrpn_Tracker_Remote(name, c) {}
  void mainloop() { vrpn_Tracker_Remote::mainloop(); }
  vrpn_Connection* connection() { return connectionPtr(); }
  void texts() {
    server_mainloop();
    send_text_message(vrpn_TEXT_ERROR)("stuck");
    send_text_message(vrpn_TEXT_WARNING) << "motor " << 3;
    char b[2000];
    encode_text_message_to_buffer(b, vrpn_TEXT_NORMAL, 0, "x");
  }
};

// A device as VRPN's documentation builds it.
class Custom : public vrpn_BaseClass {
 public:
  Custom(const char* name, vrpn_Connection* c) : vrpn_BaseClass(name, c) { vrpn_BaseClass::init(); }
  virtual void mainloop() { server_mainloop(); }

 protected:
  virtual int register_types() {
    type = d_connection->register_message_type("Custom Change");
    return type == -1 ? -1 : 0;
  }
  vrpn_int32 type;
};

// One of several classes.
class Several : public vrpn_Tracker, public vrpn_Button_Filter, public vrpn_Analog {
 public:
  Several(const char* name, vrpn_Connection* c)
      : vrpn_Tracker(name, c), vrpn_Button_Filter(name, c), vrpn_Analog(name, c) {
    vrpn_Button::num_buttons = 1;
    vrpn_Analog::num_channel = 1;
    vrpn_Tracker::register_server_handlers();
  }
  virtual void mainloop() {
    server_mainloop();
    vrpn_gettimeofday(&(vrpn_Tracker::timestamp), NULL);
    char buffer[1000];
    if (d_connection) {
      int length = vrpn_Tracker::encode_to(buffer);
      d_connection->pack_message(length, vrpn_Tracker::timestamp, position_m_id, d_sender_id, buffer,
                                 vrpn_CONNECTION_LOW_LATENCY);
    }
    vrpn_Button::report_changes();
    vrpn_Analog::report_changes();
  }
};

void devices(vrpn_Tracker_Remote* t, vrpn_Button_Remote* b, vrpn_Analog_Remote* a,
             vrpn_ForceDevice_Remote* f) {
  t->print_latest_report();
  vrpn_float64 position[3], quaternion[4];
  t->get_local_t2r(position, quaternion);
  vrpn_Tracker_Pos p;
  vrpn_Tracker_Quat q;
  (void)p;
  (void)q;
  (void)vrpn_TRACKER_FAIL;
  vrpn_Tracker_NULL null("a", 0);
  vrpn_Tracker_Server tracker("a", 0, 1);
  b->print();
  (void)VRPN_BUTTON_BUF_SIZE;
  vrpn_Button_Server button("a", 0, 2);
  a->print();
  vrpn_Analog_Server analog("a", 0, 2);
  vrpn_Text_Sender text("a@b");
  f->print_report();
  f->print_plane();
  Custom custom("a", 0);
  Several several("a", 0);
}

void rest(vrpn_Connection* c) {
  vrpn_MainloopContainer container;
  container.add(new vrpn_Tracker_Remote("a@b"));
  container.add(c);
  container.mainloop();
  vrpn_LamportClock clock(2, 0);
  delete clock.getTimestampAndAdvance();
  vrpn_Mutex_Server server("m", c);
  vrpn_Mutex_Remote remote("m@b");
  remote.request();
  remote.release();
  vrpn_RedundantTransmission redundant(c);
  redundant.enable(vrpn_TRUE);
  vrpn_RedundantReceiver receiver(c);
  receiver.record(vrpn_TRUE);
  receiver.writeMemory("f");
  receiver.clearMemory();
  vrpn_RedundantController controller(&redundant, c);
  controller.mainloop();
  vrpn_RedundantRemote redundantRemote(c);
  struct timeval interval = {0, 1};
  redundantRemote.set(3, interval);
  redundantRemote.enable(vrpn_TRUE);
  vrpn_File_Controller files(c);
  files.set_replay_rate(2.0F);
  files.reset();
  files.play_to_time(interval);
  vrpn_Forwarder_Server forwarders(c);
  vrpn_Forwarder_Controller forwards(c);
  vrpn_Forwarder_Brain* brain = &forwards;
  brain->start_remote_forwarding(4500);
  brain->forward_message_type(4500, "d", "t");
  vrpn_ConnectionForwarder forwarder(c, c);
  forwarder.forward("t", "d", "t", "e");
  vrpn_StreamForwarder stream(c, "d", c, "e");
  vrpn_Auxiliary_Logger_Remote logger("l@b");
  logger.send_logging_request("x");
}

int VRPN_CALLBACK onNumber(void*, vrpn_int32, vrpn_bool) {
  return 0;
}
int VRPN_CALLBACK onText(void*, const char*, struct timeval, vrpn_bool) {
  return 0;
}
int VRPN_CALLBACK decide(void*, vrpn_float64, struct timeval, vrpn_Shared_float64*) {
  return 1;
}
void shared(vrpn_Connection* c) {
  vrpn_Shared_int32_Remote number("a", 0, VRPN_SO_DEFER_UPDATES);
  number.bindConnection(c);
  number.register_handler(onNumber, &number);
  number.unregister_handler(onNumber, &number);
  number = 3;
  vrpn_int32 value = number;
  (void)value;
  number.becomeSerializer();
  vrpn_Shared_float64_Server length("b", 1.5, VRPN_SO_IGNORE_OLD | VRPN_SO_IGNORE_IDEMPOTENT);
  length.setSerializerPolicy(vrpn_CALLBACK, decide, NULL);
  vrpn_Shared_String_Server text("c", "d");
  text.register_handler(onText, NULL);
  text = "e";
  struct timeval now;
  vrpn_gettimeofday(&now, NULL);
  text.set("f", now);
  vrpn_SharedObject* object = &text;
  (void)object->name();
  (void)object->isSerializer();
}
