#include "realtime/remote/normal_shares.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {
namespace {

constexpr std::size_t kMost = PressingContacts::kMost;
constexpr std::size_t kMostBearers = 8;
constexpr int kExchanges = 24;
constexpr double kExact_m = 1e-12;
constexpr double kSame = 1 - 1e-12;  // of two springs with one normal and one stiffness
constexpr double kSingular = 1e-9;   // pivot by its element of the diagonal
constexpr int kSweeps = 40;
constexpr double kConverged_N = 1e-6;

// The depth of contact i that a newton of contact j takes over. Symmetric; of a contact with itself, its
// compliance. Of two springs that push the same way the softer one is relieved as if it were the stiffer. The
// proxy lies on all faces of the scene: one that pushes against another is burdened by it.
double overlap_m_per_N(const PressingContacts& c, std::size_t i, std::size_t j) noexcept {
  const double cosine = c.x[i] * c.x[j] + c.y[i] * c.y[j] + c.z[i] * c.z[j];
  const bool scene = i >= c.scene && j >= c.scene;
  return (scene ? cosine : std::max(0.0, cosine)) *
         std::min(c.compliance_m_per_N[i], c.compliance_m_per_N[j]);
}

// The contacts that bear force, usually up to three of sixteen. Given these, their shares are the solution of
// a small linear system; the set is that of the last tick, or few exchanges from it.
class Bearers {
 public:
  explicit Bearers(const PressingContacts& contacts) noexcept : c_(contacts) {}

  // From the bearers of the last tick, or from the contact that demands most. False: no solution within the
  // limits.
  bool solve(bool fromLast) noexcept {
    count_ = 0;
    if (!start(fromLast)) return false;
    for (int i = 0; i < kExchanges; ++i) {
      if (!solveSystem()) return false;
      if (count_ == 0) return mostMissing() == c_.count;  // no contact demands a push
      const std::size_t least = static_cast<std::size_t>(
          std::min_element(share_N_.begin(), share_N_.begin() + count_) - share_N_.begin());
      if (share_N_[least] < 0) {
        remove(least);
        continue;
      }
      const std::size_t missing = mostMissing();
      if (missing == c_.count) return true;
      if (!include(missing)) return false;
    }
    return false;
  }

  void write(PressingContacts& out) const noexcept {
    std::fill_n(out.share_N.begin(), out.count, 0.0);
    for (std::size_t m = 0; m < count_; ++m) out.share_N[index_[m]] = share_N_[m];
  }

 private:
  bool start(bool fromLast) noexcept {
    for (std::size_t i = 0; fromLast && i < c_.count; ++i) {
      if (c_.share_N[i] > 0 && !include(i)) return false;
    }
    if (count_ > 0) return true;
    std::size_t most = 0;
    for (std::size_t i = 1; i < c_.count; ++i) {
      if (c_.depth_m[i] * c_.compliance_m_per_N[most] > c_.depth_m[most] * c_.compliance_m_per_N[i]) most = i;
    }
    return include(most);
  }

  // Of several contacts of one plane and one stiffness, the last included one bears.
  bool include(std::size_t i) noexcept {
    std::size_t place = count_;
    for (std::size_t m = 0; m < count_; ++m) {
      const double softest = std::max(c_.compliance_m_per_N[i], c_.compliance_m_per_N[index_[m]]);
      if (overlap_[m][i] > kSame * softest) place = m;
    }
    if (place == kMostBearers) return false;
    count_ = std::max(count_, place + 1);
    index_[place] = i;
    for (std::size_t j = 0; j < c_.count; ++j) overlap_[place][j] = overlap_m_per_N(c_, i, j);
    return true;
  }

  void remove(std::size_t m) noexcept {
    --count_;
    index_[m] = index_[count_];
    overlap_[m] = overlap_[count_];
  }

  // Cholesky's factors without square roots.
  bool solveSystem() noexcept {
    std::array<std::array<double, kMostBearers>, kMostBearers> l;
    std::array<double, kMostBearers> d;
    for (std::size_t i = 0; i < count_; ++i) {
      double rest_m = c_.depth_m[index_[i]];
      double pivot = c_.compliance_m_per_N[index_[i]];
      for (std::size_t j = 0; j < i; ++j) {
        double value = overlap_[i][index_[j]];
        for (std::size_t k = 0; k < j; ++k) value -= l[i][k] * d[k] * l[j][k];
        l[i][j] = value / d[j];
        pivot -= l[i][j] * value;
        rest_m -= l[i][j] * share_N_[j];
      }
      if (pivot < kSingular * c_.compliance_m_per_N[index_[i]]) return false;
      d[i] = pivot;
      share_N_[i] = rest_m;
    }
    for (std::size_t i = count_; i-- > 0;) {
      share_N_[i] /= d[i];
      for (std::size_t k = i + 1; k < count_; ++k) share_N_[i] -= l[k][i] * share_N_[k];
    }
    return true;
  }

  // The contact whose demand the bearers meet least; `count` of the contacts when they meet all.
  std::size_t mostMissing() const noexcept {
    std::array<double, kMost> rest_m;
    std::copy_n(c_.depth_m.begin(), c_.count, rest_m.begin());
    for (std::size_t m = 0; m < count_; ++m) {
      for (std::size_t j = 0; j < c_.count; ++j) rest_m[j] -= share_N_[m] * overlap_[m][j];
    }
    std::size_t most = c_.count;
    double most_m = kExact_m;
    for (std::size_t j = 0; j < c_.count; ++j) {
      if (rest_m[j] <= most_m) continue;
      most_m = rest_m[j];
      most = j;
    }
    return most;
  }

  const PressingContacts& c_;
  std::size_t count_ = 0;
  std::array<std::size_t, kMostBearers> index_;
  std::array<double, kMostBearers> share_N_;
  std::array<std::array<double, kMost>, kMostBearers> overlap_;  // of each bearer with every contact
};

// Adjusts one share after the other. Slower, and always has an answer.
void sweep(PressingContacts& c) noexcept {
  std::array<double, kMost> rest_m;
  std::array<std::array<double, kMost>, kMost> overlaps;
  for (std::size_t i = 0; i < c.count; ++i) {
    for (std::size_t j = 0; j < i; ++j) overlaps[i][j] = overlaps[j][i] = overlap_m_per_N(c, i, j);
    overlaps[i][i] = 0;
    rest_m[i] = c.depth_m[i];
  }
  const auto take = [&](std::size_t i, double share_N) {
    for (std::size_t j = 0; j < c.count; ++j) rest_m[j] -= share_N * overlaps[i][j];
  };
  for (std::size_t i = 0; i < c.count; ++i) {
    if (c.share_N[i] > 0) take(i, c.share_N[i]);
  }
  double change_N = kConverged_N;
  for (int n = 0; n < kSweeps && change_N >= kConverged_N; ++n) {
    change_N = 0;
    for (std::size_t i = 0; i < c.count; ++i) {
      const double more_N = std::max(0.0, rest_m[i]) / c.compliance_m_per_N[i] - c.share_N[i];
      if (more_N == 0) continue;
      c.share_N[i] += more_N;
      take(i, more_N);
      change_N = std::max(change_N, std::abs(more_N));
    }
  }
}

}  // namespace

void shareNormalForce(PressingContacts& contacts) noexcept {
  if (contacts.count == 0) return;
  Bearers bearers(contacts);
  if (bearers.solve(true) || bearers.solve(false)) {
    bearers.write(contacts);
  } else {
    sweep(contacts);
  }
}

}  // namespace hapticd::realtime
