// Requests of values for the output channels of a device.
#ifndef VRPN_ANALOG_OUTPUT_H
#define VRPN_ANALOG_OUTPUT_H

#include "vrpn_Analog.h"

class vrpn_Analog_Output : public vrpn_BaseClass {
 public:
  vrpn_Analog_Output(const char* name, vrpn_Connection* connection = NULL)
      : vrpn_BaseClass(name, connection) {}
  /// As reported by the server; 0 before.
  vrpn_int32 getNumChannels() const { return o_num_channel; }

 protected:
  vrpn_int32 o_num_channel = 0;
};

class vrpn_Analog_Output_Remote : public vrpn_Analog_Output {
 public:
  vrpn_Analog_Output_Remote(const char* name, vrpn_Connection* connection = NULL)
      : vrpn_Analog_Output(name, connection) {
    listen("vrpn_Analog_Output Num_Channels_report", handleNumber, this);
  }

  virtual void mainloop() { client_mainloop(); }
  virtual bool request_change_channel_value(unsigned int channel, vrpn_float64 value,
                                            vrpn_uint32 class_of_service = vrpn_CONNECTION_RELIABLE) {
    return request("vrpn_Analog_Output Change_request", static_cast<vrpn_int32>(channel), &value, 1,
                   class_of_service);
  }
  virtual bool request_change_channels(int count, vrpn_float64* values,
                                       vrpn_uint32 class_of_service = vrpn_CONNECTION_RELIABLE) {
    if (count < 0 || count > vrpn_CHANNEL_MAX) return false;
    return request("vrpn_Analog_Output Change_Channels_request", count, values, count, class_of_service);
  }

 private:
  bool request(const char* type, vrpn_int32 number, const vrpn_float64* values, int count,
               vrpn_uint32 class_of_service) {
    if (d_connection == NULL) return false;
    char payload[(1 + vrpn_CHANNEL_MAX) * sizeof(vrpn_float64)];
    char* at = payload;
    vrpn_int32 left = sizeof payload;
    vrpn_buffer(&at, &left, number);
    vrpn_buffer(&at, &left, vrpn_int32(0));  // fills up to the alignment of the values
    for (int i = 0; i < count; ++i) vrpn_buffer(&at, &left, values[i]);
    struct timeval now;
    vrpn_gettimeofday(&now);
    return d_connection->pack_message(static_cast<vrpn_uint32>(at - payload), now,
                                      d_connection->register_message_type(type), d_sender_id, payload,
                                      class_of_service) == 0;
  }
  static int VRPN_CALLBACK handleNumber(void* self, vrpn_HANDLERPARAM p) {
    const char* payload = p.buffer;
    if (p.payload_len >= static_cast<vrpn_int32>(sizeof(vrpn_int32))) {
      vrpn_unbuffer(&payload, &static_cast<vrpn_Analog_Output_Remote*>(self)->o_num_channel);
    }
    return 0;
  }
};

#endif
