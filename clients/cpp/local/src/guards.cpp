#include "guards.hpp"

#include <algorithm>
#include <limits>

namespace wayfarer::local {
namespace {

constexpr std::size_t KNEES[] = {4, 5}, ANKLES[] = {7, 8}, SPINE[] = {3, 6, 9}, FIRST_OF_ARMS = 16;
constexpr double KNEE[] = {-5 * DEGREE, 150 * DEGREE};
const double SIDEWAYS = std::pow(std::sin(15 * DEGREE), 2);  // of half the angle beside a knee's bend, squared
constexpr double ANKLE = 35 * DEGREE;     // half the angle that an ankle is turned by at most
constexpr double ARM_MOST = 60 * DEGREE;  // that a joint of an arm turns by while a body gets up
const double FELL = std::cos(32 * DEGREE);
constexpr double FOLDED = 0.76, FAR = 3;
// degrees per frame by which the turning of a joint may change from frame to frame
constexpr double NONE = std::numeric_limits<double>::infinity();
constexpr double JERK[JOINTS] = {NONE, 5, 5, 5, 7, 7, 5, 25, 25, 5, 40, 40, 12, 7, 7, 15, 8, 8, 15, 15, 25, 25};
constexpr double WHIP = 0.06;  // metres per frame² by which the way of a foot may change
constexpr std::size_t LEGS[2][3] = {{1, 4, 7}, {2, 5, 8}};
constexpr double REACHES[] = {0.9, 0.5, 0.14};  // metres from the joints of a leg to the foot's middle

constexpr std::size_t TOTAL = SEED + FRAMES;
using Path = std::array<Quat, TOTAL>;  // of one joint: the seed's frames, then the new ones

Path path_of(const Seed& seed, const FrameTurns& turns, std::size_t joint) {
  Path path;
  for (std::size_t t = 0; t < TOTAL; ++t) path[t] = (t < SEED ? seed.turns[t] : turns[t - SEED])[joint];
  return path;
}

// largest second difference, squared
double worst_jerk(const Path& path) {
  double worst = 0;
  for (std::size_t t = 2; t < TOTAL; ++t) {
    const Quat bend = path[t] - 2 * path[t - 1] + path[t - 2];
    worst = std::max(worst, dot(bend, bend));
  }
  return worst;
}

// choose signs so that turns are near to each other: both of a quaternion mean the same turn
void make_alike(Path& path) {
  for (std::size_t t = 1; t < TOTAL; ++t)
    if (dot(path[t], path[t - 1]) < 0) path[t] = -1 * path[t];
}

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

// New frames from all of a path, [FRAMES][TOTAL]: least squares of changes and, times 2, of second differences; the
// last one stays.
struct Even {
  double shares[FRAMES][TOTAL] = {};

  Even() {
    constexpr std::size_t unknown = FRAMES - 1;
    constexpr double weight = 2, bend[] = {1, -2, 1};
    double system[TOTAL][TOTAL] = {};
    for (std::size_t i = 0; i < TOTAL; ++i) system[i][i] = 1;
    for (std::size_t t = 0; t + 2 < TOTAL; ++t)
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) system[t + i][t + k] += weight * bend[i] * bend[k];
    double rows[unknown][unknown + TOTAL] = {};
    for (std::size_t i = 0; i < unknown; ++i) {
      for (std::size_t k = 0; k < unknown; ++k) rows[i][k] = system[SEED + i][SEED + k];
      for (std::size_t k = 0; k < TOTAL; ++k)
        rows[i][unknown + k] = k < SEED || k == TOTAL - 1 ? -system[SEED + i][k] : 0;
      rows[i][unknown + SEED + i] += 1;
    }
    for (std::size_t i = 0; i < unknown; ++i) {  // positive definite: no pivoting
      const double pivot = rows[i][i];
      for (double& value : rows[i]) value /= pivot;
      for (std::size_t k = 0; k < unknown; ++k) {
        const double factor = rows[k][i];
        if (k == i) continue;
        for (std::size_t n = 0; n < unknown + TOTAL; ++n) rows[k][n] -= factor * rows[i][n];
      }
    }
    for (std::size_t i = 0; i < unknown; ++i) std::copy_n(&rows[i][unknown], TOTAL, shares[i]);
    shares[unknown][TOTAL - 1] = 1;
  }
};

// radians that a knee is bent from straight
double flexion(const Quat& q, const Vec3& rest) {
  const Vec3 shin = rotate(q, rest);
  const double bend = std::atan2(-shin.y, -shin.z) - std::atan2(-rest.y, -rest.z) + PI / 2;
  return bend - 2 * PI * std::floor(bend / (2 * PI)) - PI / 2;
}

// knees bent as knees bend
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

// ankles turned as far as ankles turn
void make_turnable(FrameTurns& frames) {
  for (Turns& turns : frames) {
    for (const std::size_t joint : ANKLES) {
      Quat& ankle = turns[joint];
      if (std::abs(ankle.w) >= std::cos(ANKLE)) continue;
      const double share =
          (ankle.w < 0 ? -1 : 1) * std::sin(ANKLE) / std::sqrt(std::max(1 - ankle.w * ankle.w, 1e-12));
      ankle = {share * ankle.x, share * ankle.y, share * ankle.z, std::cos(ANKLE)};
    }
  }
}

void make_unjerked(const Seed& seed, FrameTurns& frames, const Legs& legs) {
  make_bendable(frames, legs);
  make_turnable(frames);
  for (std::size_t joint = 1; joint < JOINTS; ++joint) {
    const double limit = std::pow(JERK[joint] * DEGREE / 2, 2);
    Path path = path_of(seed, frames, joint);
    if (!(worst_jerk(path) > limit)) continue;
    make_alike(path);
    const double jerk = worst_jerk(path);
    if (!(jerk > limit)) continue;
    const Path smooth = smoothest(path);
    if (worst_jerk(smooth) >= jerk) continue;  // where a joint came fast and ends near by
    for (std::size_t t = 0; t < FRAMES; ++t) frames[t][joint] = smooth[SEED + t];
  }
}

// the turns of a leg smoothed whose foot jumps
void make_unwhipped(const Seed& seed, const FrameHips& hips, FrameTurns& frames, const Legs& legs) {
  const auto far = [&](std::size_t side) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k)
      sum += REACHES[k] * 2 * std::sqrt(worst_jerk(path_of(seed, frames, LEGS[side][k])));
    return sum;
  };
  if (!(far(0) > WHIP || far(1) > WHIP)) return;  // nearly always: nobody need be posed
  static const Even even;
  std::array<LegPose, TOTAL> poses;
  for (std::size_t t = 0; t < TOTAL; ++t)
    poses[t] = t < SEED ? LegPose(legs, seed.hips[t], seed.turns[t]) : LegPose(legs, hips[t - SEED], frames[t - SEED]);
  for (std::size_t side = 0; side < 2; ++side) {
    const auto foot = [&](std::size_t t) { return middle(poses[t].soles[side]); };
    double jump = 0;
    for (std::size_t t = 2; t < TOTAL; ++t) jump = std::max(jump, length(foot(t) - 2 * foot(t - 1) + foot(t - 2)));
    if (!(jump > WHIP)) continue;
    for (const std::size_t joint : LEGS[side]) {
      Path path = path_of(seed, frames, joint);
      make_alike(path);
      for (std::size_t t = 0; t < FRAMES; ++t) {
        Quat turn{0, 0, 0, 0};
        for (std::size_t k = 0; k < TOTAL; ++k) turn = turn + even.shares[t][k] * path[k];
        frames[t][joint] = normalized(turn);
      }
    }
  }
}

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
bool finite(const Quat& q) { return std::isfinite(dot(q, q)); }

}  // namespace

FrameTurns smoothed(const Seed& seed, const FrameHips& hips, const FrameTurns& turns, const Legs& legs) {
  FrameTurns result = turns;
  make_unjerked(seed, result, legs);
  make_unwhipped(seed, hips, result, legs);
  return result;
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
