#include "mesh_io/mesh_io.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <utility>

#include "geometry/weld.h"

namespace hapticd::mesh_io {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3f;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& reason) {
  throw MeshError("mesh file '" + file.string() + "': " + reason);
}

void append(TriangleMesh& all, const aiMesh& part, const aiMatrix4x4& T_file_node) {
  const auto first = static_cast<std::uint32_t>(all.vertices.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    const aiVector3D v = T_file_node * part.mVertices[i];
    all.vertices.emplace_back(v.x, v.y, v.z);
  }
  // A mirror turns fronts into backs; other corners first turns them back.
  const bool mirrored = T_file_node.Determinant() < 0;
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;
    Triangle t{first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]};
    if (mirrored) std::swap(t[1], t[2]);
    all.triangles.push_back(t);
  }
}

void appendNode(TriangleMesh& all, const aiScene& scene, const aiNode& node,
                const aiMatrix4x4& T_file_parent) {
  const aiMatrix4x4 T_file_node = T_file_parent * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) append(all, *scene.mMeshes[node.mMeshes[i]], T_file_node);
  for (unsigned i = 0; i < node.mNumChildren; ++i) appendNode(all, scene, *node.mChildren[i], T_file_node);
}

}  // namespace

TriangleMesh loadMesh(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    fail(file, error ? error.message() : "not a regular file");
  }
  Assimp::Importer importer;
  // Only positions matter; points and lines go.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                  aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                  aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS |
                                  aiComponent_MATERIALS);
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(
      file.string(), aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_RemoveComponent);
  if (scene == nullptr || scene->mRootNode == nullptr) fail(file, importer.GetErrorString());

  TriangleMesh mesh;
  appendNode(mesh, *scene, *scene->mRootNode, aiMatrix4x4());
  if (mesh.triangles.empty()) fail(file, "it holds no triangles");
  geometry::weld(mesh);
  return mesh;
}

}  // namespace hapticd::mesh_io
