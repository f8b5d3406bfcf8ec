#include "figure.h"

#include <array>
#include <cstdio>
#include <cstdlib>

#include "base/printable.h"

namespace hapticd::apps {
namespace {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : base::printable(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

// About the width of Helvetica's letters, in thousandths of the size.
int widthOf(char c) {
  if (c >= '0' && c <= '9') return 556;
  if (c >= 'A' && c <= 'Z') return 680;
  const std::string_view narrow = " .,:;'|!ijltfI/()-";
  return narrow.find(c) != std::string_view::npos ? 300 : 540;
}

double widthOf(std::string_view text, double size) {
  int sum = 0;
  for (const char c : text) sum += widthOf(c);
  return sum * size / 1000;
}

std::string pdfText(std::string_view text) {
  std::string out = "(";
  for (const char c : text) {
    if (c == '(' || c == ')' || c == '\\') out += '\\';
    if (c >= 0x20 && c < 0x7f) {
      out += c;
    } else if ((static_cast<unsigned char>(c) & 0xc0U) != 0x80U) {  // once for each character of UTF-8
      out += '?';
    }
  }
  return out + ')';
}

// r g b from 0 to 1.
std::string pdfColour(const std::string& colour) {
  std::string out;
  for (const std::size_t at : {1, 3, 5}) {
    out += number(static_cast<double>(std::strtol(colour.substr(at, 2).c_str(), nullptr, 16)) / 255) + ' ';
  }
  return out;
}

}  // namespace

void Figure::line(const std::vector<std::pair<double, double>>& points, const std::string& colour,
                  double width) {
  if (points.size() < 2) return;
  items_.push_back({Item::Kind::line, points, colour, width, {}, Anchor::start, false});
}

void Figure::rectangle(double x, double y, double width, double height, const std::string& colour) {
  items_.push_back({Item::Kind::rectangle, {{x, y}, {width, height}}, colour, 0, {}, Anchor::start, false});
}

void Figure::text(double x, double y, std::string_view text, double size, const std::string& colour,
                  Anchor anchor, bool turned) {
  items_.push_back({Item::Kind::text, {{x, y}}, colour, size, std::string(text), anchor, turned});
}

std::string Figure::svg(std::string_view title) const {
  const std::string size = number(width_) + "\" height=\"" + number(height_);
  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + size + "\" viewBox=\"0 0 " +
                    number(width_) + ' ' + number(height_) +
                    "\" font-family=\"Helvetica, Arial, sans-serif\">\n<title>" + escaped(title) +
                    "</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n";
  for (const Item& item : items_) {
    const auto [x, y] = item.points.front();
    switch (item.kind) {
      case Item::Kind::line:
        out += "<polyline fill=\"none\" stroke-linejoin=\"round\" stroke=\"" + item.colour +
               "\" stroke-width=\"" + number(item.size) + "\" points=\"";
        for (const auto& [px, py] : item.points) out += number(px) + ',' + number(py) + ' ';
        out += "\"/>\n";
        break;
      case Item::Kind::rectangle:
        out += "<rect x=\"" + number(x) + "\" y=\"" + number(y) + "\" width=\"" +
               number(item.points[1].first) + "\" height=\"" + number(item.points[1].second) + "\" fill=\"" +
               item.colour + "\"/>\n";
        break;
      case Item::Kind::text: {
        constexpr std::array<const char*, 3> kAnchors = {"start", "middle", "end"};
        out += "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" font-size=\"" + number(item.size) +
               "\" fill=\"" + item.colour + "\" text-anchor=\"" +
               kAnchors[static_cast<std::size_t>(item.anchor)] + '"';
        if (item.turned) out += " transform=\"rotate(-90 " + number(x) + ' ' + number(y) + ")\"";
        out += '>' + escaped(item.text) + "</text>\n";
        break;
      }
    }
  }
  return out + "</svg>\n";
}

std::string Figure::pdf(std::string_view title) const {
  std::string content;
  for (const Item& item : items_) {
    const double x = item.points.front().first;
    const double y = height_ - item.points.front().second;  // PDF counts from below
    switch (item.kind) {
      case Item::Kind::line: {
        content += pdfColour(item.colour) + "RG " + number(item.size) + " w 1 j\n";
        char step = 'm';
        for (const auto& [px, py] : item.points) {
          content += number(px) + ' ' + number(height_ - py) + ' ' + step + '\n';
          step = 'l';
        }
        content += "S\n";
        break;
      }
      case Item::Kind::rectangle:
        content += pdfColour(item.colour) + "rg " + number(x) + ' ' + number(y - item.points[1].second) +
                   ' ' + number(item.points[1].first) + ' ' + number(item.points[1].second) + " re f\n";
        break;
      case Item::Kind::text: {
        const double back = widthOf(item.text, item.size) * 0.5 * static_cast<double>(item.anchor);
        content += "BT " + pdfColour(item.colour) + "rg /F1 " + number(item.size) + " Tf ";
        content += item.turned ? "0 1 -1 0 " + number(x) + ' ' + number(y - back)
                               : "1 0 0 1 " + number(x - back) + ' ' + number(y);
        content += " Tm " + pdfText(item.text) + " Tj ET\n";
        break;
      }
    }
  }
  const std::vector<std::string> objects = {
      "<< /Type /Catalog /Pages 2 0 R >>",
      "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 " + number(width_) + ' ' + number(height_) +
          "] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
      "<< /Length " + std::to_string(content.size()) + " >>\nstream\n" + content + "endstream",
      "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
      "<< /Title " + pdfText(title) + " /Producer (hapticd) >>"};
  std::string out = "%PDF-1.4\n";
  std::vector<std::size_t> offsets;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    offsets.push_back(out.size());
    out += std::to_string(i + 1) + " 0 obj\n" + objects[i] + "\nendobj\n";
  }
  const std::size_t table = out.size();
  const std::string count = std::to_string(objects.size() + 1);
  out += "xref\n0 " + count + "\n0000000000 65535 f \n";
  for (const std::size_t offset : offsets) {
    char row[24];
    std::snprintf(row, sizeof row, "%010zu 00000 n \n", offset);
    out += row;
  }
  return out + "trailer\n<< /Size " + count + " /Root 1 0 R /Info 6 0 R >>\nstartxref\n" +
         std::to_string(table) + "\n%%EOF\n";
}

}  // namespace hapticd::apps
