#include "mesh_io/mesh_reader.h"

#include <assimp/BaseImporter.h>
#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "geometry/weld.h"

namespace hapticd::mesh_io {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;

constexpr std::array<std::string_view, 5> kFormats = {"obj", "stl", "ply", "gltf", "glb"};
constexpr int kDeepestNode = 500;

std::string formatOf(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  if (!extension.empty()) extension.erase(0, 1);
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension;
}

// Materials, textures and files of other folders do not exist.
class OnlyGeometry final : public Assimp::DefaultIOSystem {
 public:
  explicit OnlyGeometry(const std::filesystem::path& file)
      : file_(std::filesystem::canonical(file)), withBuffers_(formatOf(file) == "gltf") {}

  bool Exists(const char* name) const override { return allowed(name); }
  Assimp::IOStream* Open(const char* name, const char* mode) override {
    return allowed(name) ? DefaultIOSystem::Open(name, mode) : nullptr;
  }

 private:
  bool allowed(const char* name) const {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(name, error);
    if (error || !std::filesystem::is_regular_file(path, error)) return false;
    return path == file_ || (withBuffers_ && path.parent_path() == file_.parent_path());
  }

  const std::filesystem::path file_;
  const bool withBuffers_;
};

// Assimp tries readers by content, too; those of other formats are removed.
void keepOnly(Assimp::Importer& importer, const std::string& format) {
  for (std::size_t i = importer.GetImporterCount(); i-- > 0;) {
    Assimp::BaseImporter* reader = importer.GetImporter(i);
    const std::string extensions = ' ' + std::string(importer.GetImporterInfo(i)->mFileExtensions) + ' ';
    if (extensions.find(' ' + format + ' ') != std::string::npos) continue;
    importer.UnregisterLoader(reader);
    delete reader;
  }
}

void append(TriangleMesh& all, const aiMesh& part, const aiMatrix4x4& T_file_node) {
  if (all.vertices.size() + part.mNumVertices > kLargestMesh ||
      all.triangles.size() + part.mNumFaces > kLargestMesh) {
    throw std::runtime_error("it has more than " + std::to_string(kLargestMesh) +
                             " triangles or vertices: reduce it");
  }
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
    // A corner that this part does not have would be a vertex of the next part.
    if (std::any_of(face.mIndices, face.mIndices + 3, [&](unsigned c) { return c >= part.mNumVertices; }))
      throw std::runtime_error("a triangle has a corner that does not exist");
    Triangle t{first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]};
    if (mirrored) std::swap(t[1], t[2]);
    all.triangles.push_back(t);
  }
}

void appendNode(TriangleMesh& all, const aiScene& scene, const aiNode& node, const aiMatrix4x4& T_file_parent,
                int depth) {
  if (depth > kDeepestNode)
    throw std::runtime_error("its nodes are nested more than " + std::to_string(kDeepestNode) + " deep");
  const aiMatrix4x4 T_file_node = T_file_parent * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    if (node.mMeshes[i] >= scene.mNumMeshes)
      throw std::runtime_error("a node has a mesh that does not exist");
    append(all, *scene.mMeshes[node.mMeshes[i]], T_file_node);
  }
  for (unsigned i = 0; i < node.mNumChildren; ++i)
    appendNode(all, scene, *node.mChildren[i], T_file_node, depth + 1);
}

}  // namespace

bool isSupported(const std::filesystem::path& file) {
  return std::find(kFormats.begin(), kFormats.end(), formatOf(file)) != kFormats.end();
}

TriangleMesh readMesh(const std::filesystem::path& file) {
  Assimp::Importer importer;
  keepOnly(importer, formatOf(file));
  importer.SetIOHandler(new OnlyGeometry(file));  // which the importer deletes
  // Only positions matter; points and lines go.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                  aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                  aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS |
                                  aiComponent_MATERIALS);
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(
      file.string(), aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_RemoveComponent);
  if (scene == nullptr || scene->mRootNode == nullptr) {
    const std::string reason = importer.GetErrorString();
    if (reason.find("bad_alloc") != std::string::npos) throw std::bad_alloc();
    throw std::runtime_error(reason.empty() ? "it cannot be read" : reason);
  }

  TriangleMesh mesh;
  appendNode(mesh, *scene, *scene->mRootNode, aiMatrix4x4(), 0);
  if (mesh.triangles.empty()) throw std::runtime_error("it holds no triangles");
  geometry::weld(mesh);
  return mesh;
}

}  // namespace hapticd::mesh_io
