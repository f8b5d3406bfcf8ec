#include "mesh_io/mesh_io.h"

#include "mesh_io/mesh_bytes.h"
#include "mesh_io/mesh_reader.h"

namespace hapticd::mesh_io {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& reason) {
  throw MeshError("mesh file '" + file.string() + "': " + reason);
}

}  // namespace

geometry::TriangleMesh loadMesh(const std::filesystem::path& file, const ConfinedLimits& limits) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error))
    fail(file, error ? error.message() : "not a regular file");
  if (!isSupported(file)) {
    fail(file, "the format '" + file.extension().string() +
                   "' is not supported: convert it to OBJ, STL, PLY, glTF or GLB");
  }
  try {
    return receivedMesh(
        runConfined(limits, [&](const ConfinedOutput& send) { sendMesh(readMesh(file), send); }));
  } catch (const std::bad_alloc&) {
    fail(file, "its triangles do not fit into the memory of this machine");
  } catch (const std::exception& reason) {
    fail(file, reason.what());
  }
}

}  // namespace hapticd::mesh_io
