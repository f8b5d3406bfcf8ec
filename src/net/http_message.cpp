#include "net/http_message.h"

#include <algorithm>

namespace hapticd::net {

std::optional<std::string_view> HttpRequest::parameter(std::string_view name) const {
  const std::string_view all = target;
  std::size_t at = all.find('?');
  while (at != std::string_view::npos) {
    const std::size_t end = all.find('&', at + 1);
    const std::string_view pair = all.substr(at + 1, end == std::string_view::npos ? end : end - at - 1);
    const std::size_t equals = pair.find('=');
    if (pair.substr(0, equals) == name) {
      return equals == std::string_view::npos ? std::string_view() : pair.substr(equals + 1);
    }
    at = end;
  }
  return std::nullopt;
}

std::size_t HttpRequest::count(std::string_view name) const {
  return static_cast<std::size_t>(
      std::count_if(headers.begin(), headers.end(), [name](const auto& h) { return h.first == name; }));
}

std::string_view HttpRequest::header(std::string_view name) const {
  const auto found =
      std::find_if(headers.begin(), headers.end(), [name](const auto& h) { return h.first == name; });
  return found == headers.end() ? std::string_view() : std::string_view(found->second);
}

HttpResponse HttpResponse::of(int status, std::string_view text, std::string contentType) {
  const auto bytes = std::as_bytes(std::span(text.data(), text.size()));
  HttpResponse response;
  response.status = status;
  response.contentType = std::move(contentType);
  response.body = std::make_shared<const Buffer>(bytes.begin(), bytes.end());
  return response;
}

}  // namespace hapticd::net
