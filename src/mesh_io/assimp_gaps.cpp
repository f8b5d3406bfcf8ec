#include "mesh_io/assimp_gaps.h"

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <charconv>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "mesh_io/polygons.h"

namespace hapticd::mesh_io {
namespace {

// A part of another stream, which it owns.
class StreamPart final : public Assimp::IOStream {
 public:
  StreamPart(std::unique_ptr<Assimp::IOStream> whole, std::size_t begin, std::size_t size, bool lowerCase)
      : whole_(std::move(whole)), begin_(begin), size_(size), lowerCase_(lowerCase) {
    whole_->Seek(begin, aiOrigin_SET);
  }

  std::size_t Read(void* out, std::size_t size, std::size_t count) override {
    if (size == 0) return 0;
    const std::size_t read = whole_->Read(out, size, std::min(count, (size_ - Tell()) / size));
    for (char& c : std::span(static_cast<char*>(out), lowerCase_ ? read * size : 0))
      c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return read;
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
  const bool lowerCase_;
};

// At most so many of the next bytes.
std::string readNext(Assimp::IOStream& file, std::size_t most) {
  std::string text(std::min(most, file.FileSize() - file.Tell()), '\0');
  text.resize(file.Read(text.data(), 1, text.size()));
  return text;
}

using Json = nlohmann::json;

// A member or an element; null where there is none.
const Json& in(const Json& json, const char* name) {
  static const Json null;
  const auto found = json.find(name);
  return found == json.end() ? null : *found;
}
const Json& in(const Json& json, const Json& index) {
  static const Json null;
  if (!json.is_array() || !index.is_number_unsigned() || index.get<std::size_t>() >= json.size()) return null;
  return json[index.get<std::size_t>()];
}

// Assimp takes whole numbers for the bits of floats where an extension says that they are none, and positions
// of sparse accessors from memory that nobody wrote. A text that is no JSON is for Assimp to refuse.
void refuseUnknownMeshes(std::string_view text) {
  const Json json = Json::parse(text, nullptr, false);
  for (const Json& one : in(json, "extensionsRequired")) {
    const std::string name = one.is_string() ? one.get<std::string>() : "";
    if (name.find("mesh") != std::string::npos && name != "KHR_draco_mesh_compression")
      refuse("it requires the extension " + name + ", which is not supported: save it without");
  }
  for (const Json& mesh : in(json, "meshes")) {
    for (const Json& primitive : in(mesh, "primitives")) {
      for (const auto& [what, index] : {std::pair{"positions", in(in(primitive, "attributes"), "POSITION")},
                                        {"corners", in(primitive, "indices")}}) {
        if (in(in(json, "accessors"), index).contains("sparse"))
          refuse(std::string("its ") + what +
                 " are a sparse accessor, which is not supported: save it without");
      }
    }
  }
}

bool isUtf16(std::string_view head) {
  if (head.size() < 4) return false;
  return (head.starts_with("\xFE\xFF") && head[2] == '\0') ||
         (head.starts_with("\xFF\xFE") && head[3] == '\0');
}

}  // namespace

void refuseUnreadable(Assimp::IOStream& file, const std::string& format) {
  constexpr std::size_t kGlbHeader = 20;
  const std::string head = readNext(file, kGlbHeader);
  if (isUtf16(head)) refuse("it is a text in UTF-16: save it in UTF-8");
  if (format == "gltf") refuseUnknownMeshes(head + readNext(file, file.FileSize()));
  if (format != "glb" || head.size() < kGlbHeader) return;
  if (head.starts_with("glTF\1")) refuse("it is glTF 1: save it as glTF 2");
  std::size_t size = 0;
  for (std::size_t i = 16; i > 12; --i) size = size << 8U | static_cast<unsigned char>(head[i - 1]);
  refuseUnknownMeshes(readNext(file, size));
}

// A text is never taken for a binary STL: its characters would be a number of triangles that needs gigabytes.
std::unique_ptr<Assimp::IOStream> asAssimpReadsIt(std::unique_ptr<Assimp::IOStream> file,
                                                  const std::string& format) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  constexpr std::size_t kStlHeader = 84;
  constexpr std::size_t kStlTriangle = 50;
  std::string head(kStlHeader, '\0');
  head.resize(file->Read(head.data(), 1, head.size()));
  file->Seek(0, aiOrigin_SET);
  const std::size_t begin = head.starts_with(kMark) ? kMark.size() : 0;
  std::size_t end = file->FileSize();
  bool lowerCase = false;
  if (format == "stl" && head.size() == kStlHeader) {
    std::size_t triangles = 0;
    for (std::size_t i = kStlHeader; i > kStlHeader - 4; --i)
      triangles = triangles << 8U | static_cast<unsigned char>(head[i - 1]);
    if (triangles > 0 && kStlHeader + kStlTriangle * triangles <= end) {
      end = kStlHeader + kStlTriangle * triangles;
    } else if (head.find("SOLID") == begin) {
      lowerCase = true;
    }
  }
  return std::make_unique<StreamPart>(std::move(file), begin, end - begin, lowerCase);
}

std::string decodedUri(std::string_view uri) {
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

}  // namespace hapticd::mesh_io
