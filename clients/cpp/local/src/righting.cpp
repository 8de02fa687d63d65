#include "righting.hpp"

#include <algorithm>

namespace wayfarer::local {
namespace {

constexpr double MOST = 14 * DEGREE, MOST_ON_THE_SPOT = 9 * DEGREE;  // lean of the spine that is left
constexpr double SHARE = 0.35, TURN_MOST = 5 * DEGREE;               // of the lean beyond it, taken off in a step
constexpr double PIVOT = 0.21;  // metres above the hips joint about which the spine bends as a whole
constexpr const char* BELOW[] = {"FWT", "BWT", "HIP", "THI", "KNE", "KNI", "SHN",
                                 "CLF", "ANK", "HEE", "TOE", "MT1", "MT5"};

double ease(std::size_t frame) { return 0.5 - 0.5 * std::cos(PI * double(frame + 1) / FRAMES); }

double share_of_lean(const std::string& marker) {
  const bool below = std::any_of(std::begin(BELOW), std::end(BELOW), [&](const char* name) { return marker.substr(1) == name; });
  if (below || marker.find("SOLE") != std::string::npos) return 0;
  if (marker.substr(1) == "NWST") return 0.5;
  return marker == "T10" ? 1 : 1.5;
}

/// A unit vector times the sine of half an angle, and its cosine.
Quat turn_about(const Vec3& axis, double angle) {
  const double sine = std::sin(angle / 2);
  return {sine * axis.x, sine * axis.y, sine * axis.z, std::cos(angle / 2)};
}

}  // namespace

std::vector<double> shares_of(const std::vector<std::string>& markers) {
  std::vector<double> shares;
  std::transform(markers.begin(), markers.end(), std::back_inserter(shares), share_of_lean);
  return shares;
}

void right(Mode mode, const std::vector<double>& shares, Step& step) {
  Quat turn = step.turns.back()[0];
  Vec3 up;
  for (const std::size_t joint : SPINE) {
    turn = multiply(turn, step.turns.back()[joint]);
    up = up + rotate(turn, {0, 0, 1});
  }
  const double aside = std::hypot(up.x, up.y), lean = std::atan2(aside, up.z);
  const double excess = lean - (mode == WALKING || mode == STOPPING || mode == STRAFING ? MOST : MOST_ON_THE_SPOT);
  if (!(excess > 0)) return;
  const double back = std::min(SHARE * excess, TURN_MOST), far = std::max(aside, 1e-6);
  const Vec3 axis{up.y / far, -up.x / far, 0};
  for (std::size_t s = 0; s < SEED; ++s) {
    const std::size_t t = FRAMES - SEED + s;
    const Vec3 pivot = step.hips[t] + rotate(step.turns[t][0], {0, 0, PIVOT});
    for (std::size_t m = 0; m < shares.size(); ++m) {
      if (shares[m] == 0) continue;
      Vec3& marker = step.markers[shares.size() * s + m];
      marker = rounded(pivot + rotate(turn_about(axis, back * ease(t) * shares[m]), marker - pivot));
    }
  }
  for (std::size_t t = 0; t < FRAMES; ++t) {
    Quat above = step.turns[t][0];
    for (const std::size_t joint : SPINE) {
      const Quat now = step.turns[t][joint];
      step.turns[t][joint] = multiply(turn_about(rotate(inverse(above), axis), back * ease(t) / 2), now);
      above = multiply(above, now);
    }
  }
}

}  // namespace wayfarer::local
