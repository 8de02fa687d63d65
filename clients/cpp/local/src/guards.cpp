#include "guards.hpp"

#include <algorithm>

namespace wayfarer::local {
namespace {

constexpr std::size_t FIRST_OF_ARMS = 16;
constexpr double KNEE[] = {-5 * DEGREE, 150 * DEGREE};
const double SIDEWAYS = std::pow(std::sin(15 * DEGREE), 2);  // of half the angle beside a knee's bend, squared
constexpr double ARM_MOST = 60 * DEGREE;  // that a joint of an arm turns by while a body gets up
const double FELL = std::cos(32 * DEGREE);
constexpr double FOLDED = 0.76, FAR = 3;

constexpr std::size_t TOTAL = SEED + FRAMES;
using Path = std::array<Quat, TOTAL>;  // of one joint: the seed's frames, then the new ones

// the rotation about a vector by as many radians as it is long
Quat turn_of(const Vec3& vector) {
  const double angle = std::max(length(vector), 1e-12), sine = std::sin(angle / 2) / angle;
  return {vector.x * sine, vector.y * sine, vector.z * sine, std::cos(angle / 2)};
}

// from one rotation to another: axis times angle, the shorter way round
Vec3 way_between(const Quat& from, const Quat& to) {
  Quat q = multiply(inverse(from), to);
  if (q.w < 0) q = -1 * q;
  const Vec3 axis{q.x, q.y, q.z};
  const double sine = length(axis);
  return (2 * std::atan2(sine, q.w) / std::max(sine, 1e-12)) * axis;
}

Vec3 at_most(const Vec3& v, double most) { return std::min(1.0, most / std::max(length(v), 1e-9)) * v; }

// the path with its new frames on the cubic that begins and ends as fast as it does
Path smoothest(const Path& path) {
  const Vec3 whole = way_between(path[1], path[TOTAL - 1]);
  const double fast = std::max(length(whole), 1e-6) * 3 / FRAMES;
  const Vec3 into = at_most(way_between(path[0], path[1]), fast);
  const Vec3 leaving = at_most(way_between(path[TOTAL - 2], path[TOTAL - 1]), fast);
  Path out = path;
  for (std::size_t k = 1; k <= FRAMES; ++k) {
    const double t = double(k) / FRAMES, t2 = t * t, t3 = t2 * t;
    const Vec3 way =
        (3 * t2 - 2 * t3) * whole + FRAMES * (t - 2 * t2 + t3) * into + FRAMES * (t3 - t2) * leaving;
    out[k + 1] = multiply(path[1], turn_of(way));
  }
  return out;
}

// radians that a knee is bent from straight
double flexion(const Quat& q, const Vec3& rest) {
  const Vec3 shin = rotate(q, rest);
  const double bend = std::atan2(-shin.y, -shin.z) - std::atan2(-rest.y, -rest.z) + PI / 2;
  return bend - 2 * PI * std::floor(bend / (2 * PI)) - PI / 2;
}

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
bool finite(const Quat& q) { return std::isfinite(dot(q, q)); }

}  // namespace

void make_bendable(FrameTurns& frames, const Legs& legs) {
  for (Turns& turns : frames) {
    for (std::size_t side = 0; side < 2; ++side) {
      Quat& knee = turns[KNEES[side]];
      const double beside = knee.y * knee.y + knee.z * knee.z;
      if (beside > SIDEWAYS) {
        const double less = std::sqrt(SIDEWAYS / std::max(beside, 1e-12));
        const double more = std::sqrt((1 - less * less * beside) / std::max(1 - beside, 1e-6));
        knee = {more * knee.x, less * knee.y, less * knee.z, more * knee.w};
      }
      const double bend = flexion(knee, legs.ankle[side]), excess = bend - bounded(bend, KNEE[0], KNEE[1]);
      if (excess != 0) knee = multiply(about_x(excess), knee);
    }
  }
}

bool fallen(const FrameHips& hips, const FrameTurns& turns, const Legs& legs) {
  Quat turn = turns.back()[0];
  double upright = 0;
  for (const std::size_t joint : SPINE) {
    turn = multiply(turn, turns.back()[joint]);
    upright += (1 - 2 * (turn.x * turn.x + turn.y * turn.y)) / 3;
  }
  return upright < FELL || hips.back().z < FOLDED * legs.standing;
}

bool broken(const Vec3& start, const Step& step) {
  for (const Vec3& marker : step.markers)
    if (!finite(marker)) return true;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    if (!finite(step.hips[t]) || length(step.hips[t] - start) > FAR) return true;
    for (const Quat& turn : step.turns[t])
      if (!finite(turn)) return true;
  }
  return false;
}

void get_up(const Seed& seed, Seed& stand, FrameHips& hips, FrameTurns& turns) {
  const Vec3 start = seed.hips[1], speed = start - seed.hips[0];
  for (std::size_t f = 0; f < FRAMES; ++f) {
    const double t = double(f + 1) / FRAMES, t2 = t * t, t3 = t2 * t;
    hips[f] = start + (3 * t2 - 2 * t3) * (stand.hips[1] - start) + FRAMES * (t - 2 * t2 + t3) * speed;
  }
  for (std::size_t joint = 0; joint < JOINTS; ++joint) {
    const bool arm = joint >= FIRST_OF_ARMS;
    const Quat& last = seed.turns[1][joint];
    Vec3 way = way_between(last, stand.turns[1][joint]);
    if (arm) way = at_most(way, ARM_MOST);
    Path path;
    path.fill(multiply(last, turn_of(way)));
    for (std::size_t t = 0; t < SEED; ++t) path[t] = seed.turns[t][joint];
    const Path smooth = smoothest(path);
    for (std::size_t t = 0; t < FRAMES; ++t) turns[t][joint] = smooth[SEED + t];
    if (arm)
      for (Turns& frame : stand.turns) frame[joint] = rounded(smooth.back());
  }
}

}  // namespace wayfarer::local
