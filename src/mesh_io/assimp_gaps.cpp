#include "mesh_io/assimp_gaps.h"

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <charconv>
#include <span>
#include <stdexcept>
#include <utility>

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

// Assimp takes whole numbers for the bits of floats where an extension says that they are none.
void refuseUnknownMeshes(std::string_view json) {
  const std::size_t list = json.find("\"extensionsRequired\"");
  if (list == std::string_view::npos) return;
  std::string_view names = json.substr(list);
  names = names.substr(0, names.find(']'));
  names.remove_prefix(std::min(names.size(), names.find('[')));
  for (std::size_t open = names.find('"'); open != std::string_view::npos; open = names.find('"')) {
    names.remove_prefix(open + 1);
    const std::string_view name = names.substr(0, names.find('"'));
    names.remove_prefix(std::min(names.size(), name.size() + 1));
    if (name.find("mesh") != std::string_view::npos && name != "KHR_draco_mesh_compression")
      throw std::runtime_error("it requires the extension " + std::string(name) +
                               ", which is not supported: save it without");
  }
}

bool isUtf16(std::string_view head) {
  if (head.size() < 4) return false;
  return (head.starts_with("\xFE\xFF") && head[2] == '\0') ||
         (head.starts_with("\xFF\xFE") && head[3] == '\0');
}

}  // namespace

void refuseWhatAssimpMisreads(Assimp::IOStream& file, const std::string& format) {
  constexpr std::size_t kGlbHeader = 20;
  const std::string head = readNext(file, kGlbHeader);
  if (isUtf16(head)) throw std::runtime_error("it is a text in UTF-16: save it in UTF-8");
  if (format == "gltf") refuseUnknownMeshes(head + readNext(file, file.FileSize()));
  if (format != "glb" || head.size() < kGlbHeader) return;
  if (head.starts_with("glTF\1")) throw std::runtime_error("it is glTF 1: save it as glTF 2");
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
