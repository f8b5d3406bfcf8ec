// Foreign mesh files: whatever happens in the confined reader, here it is a mesh or an error with the file's
// name.
#include <unistd.h>

#include <array>
#include <filesystem>
#include <string>

#include "fuzz/mesh_check.h"
#include "mesh_io/mesh_io.h"

namespace hapticd::fuzz {

// The first byte selects the format.
void mesh_file(Input input) {
  static constexpr std::array<const char*, 5> kFormats = {"obj", "stl", "ply", "gltf", "glb"};
  if (input.empty()) return;
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() /
      ("hapticd_mesh_fuzz_" + std::to_string(::getpid()) + '.' + kFormats[selector(input) % kFormats.size()]);
  std::FILE* out = std::fopen(file.c_str(), "wb");
  require(out != nullptr, "the folder for temporary files is writable");
  std::fwrite(input.data() + 1, 1, input.size() - 1, out);
  std::fclose(out);
  try {
    requireSound(
        mesh_io::loadMesh(file, {.memory_bytes = 256U << 20U, .time_s = 0.3, .networkNamespace = false}));
  } catch (const mesh_io::MeshError& error) {
    require(std::string_view(error.what()).find(file.filename().string()) != std::string_view::npos,
            "an error names the file");
  }
  std::filesystem::remove(file);
}

}  // namespace hapticd::fuzz
