// What calls of VRPN's helpers return, a line each. It compiles with VRPN's own headers, too;
// testdata/vrpn_room/values.txt is what it writes when it is linked with VRPN.
#pragma once

#include <quat.h>
#include <stdio.h>
#include <string.h>
#include <vrpn_Analog.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_Shared.h>
#include <vrpn_Thread.h>
#include <vrpn_Tracker.h>

inline void writeOwned(FILE* out, const char* what, char* text) {
  fprintf(out, "  %s: %s\n", what, text != NULL ? text : "NULL");
  delete[] text;
}
inline void writeTime(FILE* out, const struct timeval& time) {
  fprintf(out, "%ld %ld\n", static_cast<long>(time.tv_sec), static_cast<long>(time.tv_usec));
}

inline void writeNames(FILE* out) {
  const char* const names[] = {"b:3",     "a@b",        "a@b:3",        "a@tcp://b:77", "tcp://b",
                               "tcp:b:9", "x-vrpn:b:4", "x-vrpn://b:4", "file:x",       "file:///x/y",
                               "",        ":3883",      "localhost"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    const char* const name = names[i];
    fprintf(out, "[%s]\n", name);
    if (strncmp(name, "file:", 5) == 0) {
      writeOwned(out, "file", vrpn_copy_file_name(name));
    } else {
      char* const location = vrpn_copy_service_location(name);
      writeOwned(out, "machine", vrpn_copy_machine_name(location));
      delete[] location;
      fprintf(out, "  port: %d\n", vrpn_get_port_number(name));
    }
    writeOwned(out, "service", vrpn_copy_service_name(name));
    writeOwned(out, "location", vrpn_copy_service_location(name));
    writeOwned(out, "renamed", vrpn_set_service_name(name, "Z"));
  }
}

inline void writeCookies(FILE* out) {
  for (long mode = 0; mode < 4; ++mode) {
    char cookie[40] = {};
    fprintf(out, "cookie %d", write_vrpn_cookie(cookie, sizeof cookie, mode));
    for (int i = 0; i < 25; ++i) fprintf(out, " %02x", static_cast<unsigned char>(cookie[i]));
    fprintf(out, "\n");
  }
  char cookie[40];
  fprintf(out, "%d %d\n", static_cast<int>(vrpn_cookie_size()), write_vrpn_cookie(cookie, 24, 0));
  const char* const peers[] = {"x", "vrpn: ver. 07.38", "vrpn: ver. 07.20", "vrpn: ver. 06.38"};
  for (int i = 0; i < 4; ++i) fprintf(out, "%s: %d\n", peers[i], check_vrpn_cookie(peers[i]));
}

inline void writeNumbers(FILE* out) {
  fprintf(out, "%ld %ld %ld %d %d %d %d %d %g\n", vrpn_LOG_NONE, vrpn_LOG_INCOMING, vrpn_LOG_OUTGOING,
          static_cast<int>(vrpn_CONNECTION_SENDER_DESCRIPTION),
          static_cast<int>(vrpn_CONNECTION_DISCONNECT_MESSAGE), static_cast<int>(vrpn_CONNECTION_MAX_TYPES),
          static_cast<int>(vrpn_MAX_ENDPOINTS), static_cast<int>(vrpn_ALIGN), VRPN_INCHES_TO_METERS);
  fprintf(out, "%d %d %d %d\n", VRPN_BUTTON_BUF_SIZE, static_cast<int>(vrpn_TRACKER_FAIL),
          vrpn_BUTTON_TOGGLE_ON, static_cast<int>(vrpn_CHANNEL_MAX));
  const double swapped = vrpn_htond(1.5);
  unsigned char bytes[8];
  memcpy(bytes, &swapped, 8);
  for (int i = 0; i < 8; ++i) fprintf(out, "%02x", bytes[i]);
  fprintf(out, " %g\n", vrpn_ntohd(swapped));
  char text[9] = "aaaaaaaa";
  vrpn_strncpynull(text, "x", 9);
  fprintf(out, "%s\n", text);
  vrpn_strncpynull(text, "0123456789", 9);
  fprintf(out, "%s\n", text);
  const char* from = "12345678";
  const vrpn_int32 number = vrpn_unbuffer<vrpn_int32>(from);
  fprintf(out, "%d %s\n", number, from);
  char room[16];
  char* at = room;
  vrpn_int32 left = 10;
  const int first = vrpn_buffer(&at, &left, static_cast<vrpn_float64>(2.5));
  const int leftThen = left;
  const int second = vrpn_buffer(&at, &left, static_cast<vrpn_int32>(2));
  fprintf(out, "%d %d %d %d\n", first, leftThen, second, left);
  vrpn_Semaphore semaphore(1);
  const int one = semaphore.condP();
  const int two = semaphore.condP();
  const int three = semaphore.v();
  fprintf(out, "%d %d %d %d\n", one, two, three, semaphore.numResources());
  const struct timeval a = {3, 700000};
  const struct timeval b = {1, 900000};
  writeTime(out, vrpn_TimevalSum(a, b));
  writeTime(out, vrpn_TimevalDiff(a, b));
  writeTime(out, vrpn_TimevalDiff(b, a));
  writeTime(out, vrpn_TimevalScale(a, 1.5));
  fprintf(out, "%g %lu %d\n", vrpn_TimevalMsecs(a), vrpn_TimevalDuration(a, b),
          vrpn_TimevalGreater(a, b) ? 1 : 0);
  q_type q, r, t;
  q_vec_type v = {1, 2, 3};
  q_make(q, 0, 0, 1, 0.5);
  q_from_euler(r, 0.1, 0.2, 0.3);
  q_mult(t, q, r);
  q_xform(v, t, v);
  fprintf(out, "%.6f %.6f %.6f %.6f, %.6f %.6f %.6f\n", t[0], t[1], t[2], t[3], v[0], v[1], v[2]);
  q_to_euler(v, t);
  fprintf(out, "%.6f %.6f %.6f\n", v[0], v[1], v[2]);
}

inline void writeDevices(FILE* out) {
  vrpn_Connection* const connection = vrpn_create_server_connection("loopback:");
  {
    vrpn_Tracker_Remote tracker("T", connection);
    vrpn_float64 position[3], quaternion[4];
    tracker.get_local_t2r(position, quaternion);
    fprintf(out, "%g %g\n", position[0], quaternion[3]);
    tracker.get_local_u2s(0, position, quaternion);
    fprintf(out, "%g %g\n", position[0], quaternion[3]);
    vrpn_Button_Server button("S", connection, 2);
    const int known = button.set_button(1, 1);
    fprintf(out, "%d %d %d\n", button.number_of_buttons(), known, button.set_button(2, 1));
    vrpn_Analog_Server analog("S", connection, 2);
    const int fewer = analog.setNumChannels(1);
    fprintf(out, "%d %d\n", fewer, analog.setNumChannels(900));
  }
  fprintf(out, "%d %d\n", connection->register_log_filter(NULL, NULL), connection->save_log_so_far());
  fprintf(out, "%d %d %d\n", connection->get_File_Connection() != NULL, connection->doing_okay() ? 1 : 0,
          connection->connected() ? 1 : 0);
  fprintf(out, "%s %s\n", connection->sender_name(connection->register_sender("S")),
          connection->message_type_name(connection->register_message_type("Q")));
  fprintf(out, "%d\n", vrpn_ConnectionManager::instance().getByName("nothing") != NULL);
  connection->removeReference();
}

inline void writeValues(FILE* out) {
  writeNames(out);
  writeCookies(out);
  writeNumbers(out);
  writeDevices(out);
}
