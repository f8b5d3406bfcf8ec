// What other programs write and Assimp does not read, or reads as something else.
#pragma once

#include <assimp/IOStream.hpp>
#include <memory>
#include <string>
#include <string_view>

namespace hapticd::mesh_io {

/// Throws std::runtime_error for a text in UTF-16, for glTF 1 in one file, and for a glTF that requires an
/// extension of meshes which Assimp ignores.
void refuseUnreadable(Assimp::IOStream& file, const std::string& format);

/// The file without a byte order mark before its text, without bytes after the last triangle of a binary STL,
/// and in lower case where an STL is in upper case.
std::unique_ptr<Assimp::IOStream> asAssimpReadsIt(std::unique_ptr<Assimp::IOStream> file,
                                                  const std::string& format);

/// The bytes that a URI means: %20 is a space.
std::string decodedUri(std::string_view uri);

}  // namespace hapticd::mesh_io
