#include "geometry/orientation.h"

#include <array>
#include <cmath>
#include <limits>

namespace hapticd::geometry {
namespace {

constexpr double kHalfUlp = std::numeric_limits<double>::epsilon() / 2;

int signOf(double value) noexcept {
  return (value > 0 ? 1 : 0) - (value < 0 ? 1 : 0);
}

// The exact sum of doubles as a non-overlapping expansion, smallest component first (Shewchuk 1997). The
// rounding error of each addition becomes a component, so the sum stays exact.
template <std::size_t N>
class ExactSum {
 public:
  void add(double term) noexcept {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double sum = term + parts_[i];
      const double added = sum - term;
      const double error = (term - (sum - added)) + (parts_[i] - added);
      if (error != 0) parts_[kept++] = error;
      term = sum;
    }
    if (term != 0) parts_[kept++] = term;
    size_ = kept;
  }
  int sign() const noexcept { return size_ == 0 ? 0 : signOf(parts_[size_ - 1]); }

 private:
  std::array<double, N> parts_{};
  std::size_t size_ = 0;
};

using Sum3 = ExactSum<48>;

// The product of two floats is exact in a double; so is each half of that double times a third float.
void addProduct(Sum3& sum, double sign, float x, float y, float z) noexcept {
  const double xy = double{x} * double{y};
  constexpr double kSplit = 134217729;  // 2^27 + 1
  const double scaled = kSplit * xy;
  const double upper = scaled - (scaled - xy);
  sum.add(sign * upper * double{z});
  sum.add(sign * (xy - upper) * double{z});
}

void addDeterminant(Sum3& sum, double sign, const Vec3f& p, const Vec3f& q, const Vec3f& r) noexcept {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    addProduct(sum, sign, p[i], q[j], r[k]);
    addProduct(sum, -sign, p[i], q[k], r[j]);
  }
}

int exactOrientation(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d) noexcept {
  Sum3 sum;
  addDeterminant(sum, 1, a, b, c);
  addDeterminant(sum, -1, a, b, d);
  addDeterminant(sum, 1, a, c, d);
  addDeterminant(sum, -1, b, c, d);
  return sum.sign();
}

}  // namespace

// kError bounds the rounding error of the determinant, relative to the sum of the magnitudes of its terms;
// when that sum is 0, so are all terms.
int orientation(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, ExactCount& exact) noexcept {
  constexpr double kError = (7 + 56 * kHalfUlp) * kHalfUlp;
  const Vec3 base = d.cast<double>();
  const Vec3 u = a.cast<double>() - base;
  const Vec3 v = b.cast<double>() - base;
  const Vec3 w = c.cast<double>() - base;
  double determinant = 0;
  double magnitude = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    const double vw = v[j] * w[k];
    const double wv = v[k] * w[j];
    determinant += u[i] * (vw - wv);
    magnitude += std::abs(u[i]) * (std::abs(vw) + std::abs(wv));
  }
  if (magnitude == 0 || std::abs(determinant) > kError * magnitude) return signOf(determinant);
  ++exact;
  return exactOrientation(a, b, c, d);
}

int orientationAlong(int axis, const Vec3f& a, const Vec3f& b, const Vec3f& c, ExactCount& exact) noexcept {
  constexpr double kError = (3 + 16 * kHalfUlp) * kHalfUlp;
  const int x = (axis + 1) % 3;
  const int y = (axis + 2) % 3;
  const auto product = [](float p, float q) { return double{p} * double{q}; };
  const double left = (double{a[x]} - double{c[x]}) * (double{b[y]} - double{c[y]});
  const double right = (double{a[y]} - double{c[y]}) * (double{b[x]} - double{c[x]});
  const double magnitude = std::abs(left) + std::abs(right);
  if (magnitude == 0 || std::abs(left - right) > kError * magnitude) return signOf(left - right);
  ++exact;
  ExactSum<6> sum;
  for (const auto& [p, q] : {std::pair(&a, &b), std::pair(&b, &c), std::pair(&c, &a)}) {
    sum.add(product((*p)[x], (*q)[y]));
    sum.add(-product((*p)[y], (*q)[x]));
  }
  return sum.sign();
}

}  // namespace hapticd::geometry
