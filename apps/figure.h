// A figure of lines and text, written as SVG or PDF.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace hapticd::apps {

/// Lengths in points from the upper left corner. Colours are #rrggbb.
class Figure {
 public:
  enum class Anchor { start, middle, end };

  Figure(double width, double height) : width_(width), height_(height) {}

  void line(const std::vector<std::pair<double, double>>& points, const std::string& colour, double width);
  void rectangle(double x, double y, double width, double height, const std::string& colour);
  /// `turned`: reads upwards. Text that is not ASCII is shown as '?' in PDF.
  void text(double x, double y, std::string_view text, double size, const std::string& colour,
            Anchor anchor = Anchor::start, bool turned = false);

  std::string svg(std::string_view title) const;
  /// One page with the standard font Helvetica, which no file must hold.
  std::string pdf(std::string_view title) const;

 private:
  struct Item {
    enum class Kind { line, rectangle, text } kind = Kind::line;
    std::vector<std::pair<double, double>> points;  // of a rectangle: corner and size
    std::string colour;
    double size = 1;  // width of a line, height of text
    std::string text;
    Anchor anchor = Anchor::start;
    bool turned = false;
  };

  double width_;
  double height_;
  std::vector<Item> items_;
};

}  // namespace hapticd::apps
