// The parsers of bytes from outside, each as a function that aborts when a property is violated. libFuzzer
// searches for bytes that do so (fuzz/libfuzzer.cpp), and tests/fuzz replays the committed corpora.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string_view>

namespace hapticd::fuzz {

using Input = std::span<const std::byte>;

void wire_message(Input input);     // a payload as one kind of message
void wire_frames(Input input);      // a run of frames, and the payloads of system messages
void wire_peer(Input input);        // a connection: TCP stream, cut anywhere, and a datagram
void udp_request(Input input);      // the datagram that asks for a reverse connection
void http(Input input);             // requests of a browser, up to the WebSocket
void web_socket(Input input);       // the frames behind it
void vrpn_cfg(Input input);         // the configuration of a stock server
void toml_config(Input input);      // our configuration
void recording(Input input);        // session files: as they are, and as blocks with valid checksums
void hand_csv(Input input);         // the path of a simulated hand
void hand_traj(Input input);        // a measured trajectory
void haply_json(Input input);       // states of the Inverse Service
void isolation_block(Input input);  // memory shared with the process of a driver
void mesh_bytes(Input input);       // the mesh that the confined reader of a foreign file sends
void mesh_file(Input input);        // foreign mesh files, in that confined reader
void remote_input(Input input);     // remote contacts and held forces, up to the force on the hand
void whole_server(Input input);     // messages of several clients, through a simulated server to the hand

inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "violated: %s\n", what);
  std::abort();
}

inline std::string_view textOf(Input input) {
  return {reinterpret_cast<const char*>(input.data()), input.size()};
}

/// The first byte, which selects a variant; 0 without any.
inline unsigned selector(Input input) {
  return input.empty() ? 0U : static_cast<unsigned>(input.front());
}

}  // namespace hapticd::fuzz
