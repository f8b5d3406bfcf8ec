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

// States of an analog's driver.
const int vrpn_ANALOG_SYNCING = 2;
const int vrpn_ANALOG_REPORT_READY = 1;
const int vrpn_ANALOG_PARTIAL = 0;
const int vrpn_ANALOG_RESETTING = -1;
const int vrpn_ANALOG_FAIL = -2;
const struct timeval vrpn_ANALOG_NOW = {0, 0};

class VRPN_API vrpn_Analog : public vrpn_BaseClass {
 public:
  vrpn_Analog(const char* name, vrpn_Connection* connection = NULL);
  void print();
  vrpn_int32 getNumChannels() const { return num_channel; }

 protected:
  virtual int register_types();
  /// Writes the payload of all channels; returns its size.
  virtual vrpn_int32 encode_to(char* buffer);
  /// Reports all channels, always or if one differs from what was reported last.
  virtual void report_changes(vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY,
                              const struct timeval time = vrpn_ANALOG_NOW);
  virtual void report(vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY,
                      const struct timeval time = vrpn_ANALOG_NOW);

  vrpn_float64 channel[vrpn_CHANNEL_MAX] = {};
  vrpn_float64 last[vrpn_CHANNEL_MAX] = {};
  vrpn_int32 num_channel = 0;
  struct timeval timestamp = {};
  vrpn_int32 channel_m_id = -1;
  int status = vrpn_ANALOG_RESETTING;
};

/// Serves channels that the program sets.
class VRPN_API vrpn_Analog_Server : public vrpn_Analog {
 public:
  vrpn_Analog_Server(const char* name, vrpn_Connection* connection, vrpn_int32 channels = vrpn_CHANNEL_MAX);

  virtual void report_changes(vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY,
                              const struct timeval time = vrpn_ANALOG_NOW) {
    vrpn_Analog::report_changes(class_of_service, time);
  }
  virtual void report(vrpn_uint32 class_of_service = vrpn_CONNECTION_LOW_LATENCY,
                      const struct timeval time = vrpn_ANALOG_NOW) {
    vrpn_Analog::report(class_of_service, time);
  }
  virtual void mainloop() { server_mainloop(); }
  vrpn_float64* channels() { return channel; }
  /// Limited to 0 … vrpn_CHANNEL_MAX; returns the number.
  vrpn_int32 setNumChannels(vrpn_int32 channels);
};

/// The same, with values that it maps to -1 … 1.
class VRPN_API vrpn_Clipping_Analog_Server : public vrpn_Analog_Server {
 public:
  vrpn_Clipping_Analog_Server(const char* name, vrpn_Connection* connection,
                              vrpn_int32 channels = vrpn_CHANNEL_MAX);
  /// Maps minimum to -1, lower_zero … upper_zero to 0 and maximum to 1. -1 for a channel that does not exist.
  int setClipValues(int channel, double minimum, double lower_zero, double upper_zero, double maximum);
  int setChannelValue(int channel, double value);

 private:
  struct Clip {
    double minimum, lowerZero, upperZero, maximum;
  };
  std::vector<Clip> clips_;
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
