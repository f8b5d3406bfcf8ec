#include "mesh_io/mesh_reader.h"

#include <assimp/BaseImporter.h>
#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/IOStream.hpp>
#include <assimp/Importer.hpp>
#include <charconv>
#include <memory>
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

// A part of another stream, which it owns.
class StreamPart final : public Assimp::IOStream {
 public:
  StreamPart(Assimp::IOStream* whole, std::size_t begin, std::size_t size)
      : whole_(whole), begin_(begin), size_(size) {
    whole_->Seek(begin, aiOrigin_SET);
  }

  std::size_t Read(void* out, std::size_t size, std::size_t count) override {
    return size == 0 ? 0 : whole_->Read(out, size, std::min(count, (size_ - Tell()) / size));
  }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  aiReturn Seek(std::size_t offset, aiOrigin origin) override {
    const std::size_t from = origin == aiOrigin_SET ? 0 : origin == aiOrigin_CUR ? Tell() : size_;
    const std::size_t to = from + offset;  // an offset back wraps around
    return to > size_ ? aiReturn_FAILURE : whole_->Seek(begin_ + to, aiOrigin_SET);
  }
  std::size_t Tell() const override { return whole_->Tell() - begin_; }
  std::size_t FileSize() const override { return size_; }
  void Flush() override {}

 private:
  const std::unique_ptr<Assimp::IOStream> whole_;
  const std::size_t begin_;
  const std::size_t size_;
};

// Without what Assimp does not expect and other programs write: a byte order mark before a text, and bytes
// after the last triangle of a binary STL. A text is never taken for one: its characters would be a number of
// triangles that needs gigabytes.
std::unique_ptr<Assimp::IOStream> withoutSurplus(std::unique_ptr<Assimp::IOStream> file,
                                                 const std::string& format) {
  constexpr std::size_t kStlHeader = 84;
  constexpr std::size_t kStlTriangle = 50;
  const std::size_t size = file->FileSize();
  std::array<unsigned char, kStlHeader> head{};
  const std::size_t known = file->Read(head.data(), 1, head.size());
  file->Seek(0, aiOrigin_SET);
  constexpr std::size_t kMark = 3;
  if (known >= kMark && head[0] == 0xEF && head[1] == 0xBB && head[2] == 0xBF)
    return std::make_unique<StreamPart>(file.release(), kMark, size - kMark);
  if (format != "stl" || known < kStlHeader) return file;
  std::size_t triangles = 0;
  for (std::size_t i = kStlHeader; i > kStlHeader - 4; --i) triangles = triangles << 8U | head[i - 1];
  const std::size_t end = kStlHeader + kStlTriangle * triangles;
  if (triangles == 0 || end >= size) return file;
  return std::make_unique<StreamPart>(file.release(), 0, end);
}

// The bytes that a URI means: %20 is a space.
std::string decoded(std::string_view uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned char value = 0;
    const bool hex = uri[i] == '%' && i + 2 < uri.size() &&
                     std::from_chars(&uri[i + 1], &uri[i + 1] + 2, value, 16).ptr == &uri[i + 1] + 2;
    text += hex ? static_cast<char>(value) : uri[i];
    if (hex) i += 2;
  }
  return text;
}

// Materials, textures and files of other folders do not exist.
class OnlyGeometry final : public Assimp::DefaultIOSystem {
 public:
  explicit OnlyGeometry(const std::filesystem::path& file)
      : file_(std::filesystem::canonical(file)), format_(formatOf(file)) {}

  bool Exists(const char* name) const override { return allowed(name) || allowed(decoded(name)); }
  Assimp::IOStream* Open(const char* name, const char* mode) override {
    const std::string path = allowed(name) ? name : decoded(name);
    if (!allowed(path)) return nullptr;
    std::unique_ptr<Assimp::IOStream> file(DefaultIOSystem::Open(path.c_str(), mode));
    return file ? withoutSurplus(std::move(file), format_).release() : nullptr;
  }

 private:
  bool allowed(const std::string& name) const {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(name, error);
    if (error || !std::filesystem::is_regular_file(path, error)) return false;
    return path == file_ || (format_ == "gltf" && path.parent_path() == file_.parent_path());
  }

  const std::filesystem::path file_;
  const std::string format_;
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
