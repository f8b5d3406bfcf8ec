#include "mesh_io/mesh_reader.h"

#include <assimp/BaseImporter.h>
#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

#include "geometry/weld.h"
#include "mesh_io/assimp_gaps.h"
#include "mesh_io/obj_file.h"
#include "mesh_io/ply_file.h"
#include "mesh_io/triangulation.h"

namespace hapticd::mesh_io {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;

constexpr std::array<std::string_view, 5> kFormats = {"obj", "stl", "ply", "gltf", "glb"};
constexpr int kDeepestNode = 500;
constexpr const char* kNoSuchCorner = "a triangle has a corner that does not exist";

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
      : file_(std::filesystem::canonical(file)), format_(formatOf(file)) {}

  bool Exists(const char* name) const override { return allowed(name) || allowed(decodedUri(name)); }
  Assimp::IOStream* Open(const char* name, const char* mode) override {
    const std::string path = allowed(name) ? name : decodedUri(name);
    if (!allowed(path)) return nullptr;
    std::unique_ptr<Assimp::IOStream> file(DefaultIOSystem::Open(path.c_str(), mode));
    return file ? asAssimpReadsIt(std::move(file), format_).release() : nullptr;
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

// Assimp's own readers of PLY and OBJ lose or invent triangles, and that of PLY crashes.
using Parse = PolygonMesh(std::string_view bytes);

Parse* parserOf(const std::string& format) {
  return format == "ply" ? parsePly : format == "obj" ? parseObj : nullptr;
}

// Assimp leaves out triangles of a glTF whose corners do not exist, and tells only its log.
class DroppedFaces {
 public:
  DroppedFaces() {
    Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(new Warnings(any_), Assimp::Logger::Warn);
  }
  ~DroppedFaces() { Assimp::DefaultLogger::kill(); }
  DroppedFaces(const DroppedFaces&) = delete;
  DroppedFaces& operator=(const DroppedFaces&) = delete;
  bool any() const noexcept { return any_; }

 private:
  class Warnings final : public Assimp::LogStream {
   public:
    explicit Warnings(bool& any) : any_(any) {}
    void write(const char* message) override {
      if (std::string_view(message).find("faces were dropped") != std::string_view::npos) any_ = true;
    }

   private:
    bool& any_;
  };
  bool any_ = false;
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
  requireRoom(all.vertices.size() + part.mNumVertices);
  requireRoom(all.triangles.size() + part.mNumFaces);
  const auto first = static_cast<std::uint32_t>(all.vertices.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    const aiVector3D v = T_file_node * part.mVertices[i];
    all.vertices.emplace_back(v.x, v.y, v.z);
  }
  // A mirror turns fronts into backs; other corners first turns them back.
  const bool mirrored = T_file_node.Determinant() < 0;
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;  // a point or a line
    // A corner that this part does not have would be a vertex of the next part.
    if (std::any_of(face.mIndices, face.mIndices + 3, [&](unsigned c) { return c >= part.mNumVertices; }))
      refuse(kNoSuchCorner);
    Triangle t{first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]};
    if (mirrored) std::swap(t[1], t[2]);
    all.triangles.push_back(t);
  }
}

void appendNode(TriangleMesh& all, const aiScene& scene, const aiNode& node, const aiMatrix4x4& T_file_parent,
                int depth) {
  if (depth > kDeepestNode)
    refuse("its nodes are nested more than " + std::to_string(kDeepestNode) + " deep");
  const aiMatrix4x4 T_file_node = T_file_parent * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    if (node.mMeshes[i] >= scene.mNumMeshes) refuse("a node has a mesh that does not exist");
    append(all, *scene.mMeshes[node.mMeshes[i]], T_file_node);
  }
  for (unsigned i = 0; i < node.mNumChildren; ++i)
    appendNode(all, scene, *node.mChildren[i], T_file_node, depth + 1);
}

// Assimp names its own parts where a file has no triangles, or another format.
std::string explained(const std::string& reason, const std::string& format) {
  const auto names = [&](std::string_view text) { return reason.find(text) != std::string::npos; };
  if (names("File is empty")) return "it holds no triangles";
  if (names("No suitable reader") || names("Failed to determine STL"))
    return "it is not a ." + format + " file";
  return reason.empty() ? "it cannot be read" : reason;
}

TriangleMesh throughAssimp(const std::filesystem::path& file, const std::string& format) {
  Assimp::Importer importer;
  keepOnly(importer, format);
  importer.SetIOHandler(new OnlyGeometry(file));  // which the importer deletes
  const DroppedFaces dropped;
  // Only positions matter.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                  aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                  aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS |
                                  aiComponent_MATERIALS);
  const aiScene* scene = importer.ReadFile(file.string(), aiProcess_RemoveComponent);
  if (scene == nullptr || scene->mRootNode == nullptr) {
    const std::string reason = importer.GetErrorString();
    if (reason.find("bad_alloc") != std::string::npos) throw std::bad_alloc();
    refuse(explained(reason, format));
  }
  if (dropped.any()) refuse(kNoSuchCorner);
  TriangleMesh mesh;
  appendNode(mesh, *scene, *scene->mRootNode, aiMatrix4x4(), 0);
  return mesh;
}

}  // namespace

bool isSupported(const std::filesystem::path& file) {
  return std::find(kFormats.begin(), kFormats.end(), formatOf(file)) != kFormats.end();
}

TriangleMesh readMesh(const std::filesystem::path& file) {
  const std::string format = formatOf(file);
  const std::unique_ptr<Assimp::IOStream> content(OnlyGeometry(file).Open(file.c_str(), "rb"));
  if (!content) refuse("it cannot be read");
  refuseUnreadable(*content, format);
  TriangleMesh mesh;
  if (Parse* const parse = parserOf(format)) {
    content->Seek(0, aiOrigin_SET);
    std::string bytes(content->FileSize(), '\0');
    bytes.resize(content->Read(bytes.data(), 1, bytes.size()));
    mesh = triangulated(parse(bytes));
  } else {
    mesh = throughAssimp(file, format);
  }
  if (mesh.triangles.empty()) refuse("it holds no triangles");
  geometry::weld(mesh);
  return mesh;
}

}  // namespace hapticd::mesh_io
