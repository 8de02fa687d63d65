#include "posture.hpp"

#include "random.hpp"

namespace wayfarer::local {
namespace {

constexpr double UPRIGHT[] = {-1.5, 1.5}, LEVEL[] = {-13, -3}, ASIDE[] = {-1, 10}, ELBOWS[] = {0, 22},
                 TURNED[] = {-3, 16};     // degrees
constexpr double FOLLOW = 1 / (0.4 * FPS);  // share by which the remembered lean and pitch follow in a frame
constexpr double TRUNK_SHARE = 0.85, TRUNK_MOST = 5 * DEGREE, HEAD_SHARE = 0.6, HEAD_MOST = 15 * DEGREE;
constexpr double CALMING = 1 / (1.2 * FPS), LEAVING = 1 / (0.6 * FPS), HANGING = -4 * DEGREE,
                 HANGING_MOST = 45 * DEGREE, HANGING_ASIDE = 3 * DEGREE;
constexpr Vec3 RELAXED{0, -4 * DEGREE, 6 * DEGREE}, PALM{-2 * DEGREE, -14 * DEGREE, -7 * DEGREE};
constexpr double SWING[] = {0.5, 1.8}, SWING_MOST = 20 * DEGREE, UNEVEN = 5 * DEGREE, HANDS[] = {20, 14};
constexpr std::size_t TRUNK[] = {3, 6, 9}, SPINE = 3, NECK = 12, HEAD = 15;
constexpr std::size_t SHOULDERS[] = {16, 17}, ELBOW_JOINTS[] = {18, 19}, WRISTS[] = {20, 21};
constexpr double SIDES[] = {-1, 1};

double between(const double (&ends)[2], double share) { return ends[0] + (ends[1] - ends[0]) * share; }

// radians that what points ahead looks up
double pitch(const Quat& q) { return std::asin(bounded(2 * (q.y * q.z + q.x * q.w), -1, 1)); }

void turn_before(Quat& turn, double x, double y, double z) { turn = unit(multiply({x, y, z, 1}, turn)); }

// brings a rotation so far to one by small angles, mirrored on the left side; not of unit length
void relax(Quat& turn, const Vec3& angles, double sign, double rest) {
  const Quat still = unit(Quat{0.5 * angles.x, 0.5 * sign * angles.y, 0.5 * sign * angles.z, 1});
  const double near = turn.w < 0 ? -1 : 1;
  turn.x += rest * (near * still.x - turn.x);
  turn.y += rest * (near * still.y - turn.y);
  turn.z += rest * (near * still.z - turn.z);
  turn.w += rest * (near * still.w - turn.w);
}

// `vertical`: where an arm at rest points
void arm(Turns& turns, std::size_t side, const Habits& own, double vertical, double rest) {
  const double sign = SIDES[side];
  Quat& shoulder = turns[SHOULDERS[side]];
  const auto [x, y, z, w] = shoulder;
  const double ahead = sign * 2 * (x * y + w * z), down = -sign * 2 * (x * z - w * y);
  const double hangs = bounded(2 * down - 0.4, 0, 1);
  const double off = vertical - std::atan2(ahead, std::max(down, 0.2));
  const double swings = bounded((1 - own.swing) * off, -SWING_MOST, SWING_MOST);
  const double more = (swings + rest * (bounded(off, -HANGING_MOST, HANGING_MOST) - swings)) * hangs;
  const double aside = (own.aside[side] + HANGING_ASIDE * rest) * hangs;
  turn_before(shoulder, 0.5 * more, -0.5 * sign * aside, -0.5 * sign * own.turned * hangs);
  relax(turns[ELBOW_JOINTS[side]], RELAXED, sign, rest);
  relax(turns[WRISTS[side]], PALM, sign, rest);
  turn_before(turns[ELBOW_JOINTS[side]], 0, 0, 0.5 * sign * own.elbows[side]);
  turn_before(turns[WRISTS[side]], 0.5 * own.hands[0], 0.5 * sign * own.hands[1], 0);
}

}  // namespace

Habits habits_of(std::uint64_t seed) {
  const auto numbers = habit_numbers(seed);
  const auto [swing, aside, elbows, turned, about, bent, lean, level, more0, more1, more2, more3] = numbers;
  const auto uneven = [](double number) { return (2 * number - 1) * UNEVEN; };
  const auto signed_of = [](double most, double number) { return between({-most, most}, number) * DEGREE; };
  const double out = between(ASIDE, aside) * DEGREE, bend = between(ELBOWS, elbows) * DEGREE;
  return {between(SWING, swing),
          {out + uneven(more0) / 2, out + uneven(more1) / 2},
          {std::max(bend + uneven(more2), 0.0), std::max(bend + uneven(more3), 0.0)},
          between(TURNED, turned) * DEGREE,
          {signed_of(HANDS[0], about), signed_of(HANDS[1], bent)},
          between(UPRIGHT, lean) * DEGREE,
          between(LEVEL, level) * DEGREE};
}

Looks looks(const Turns& turns) {
  Quat chest = turns[0];
  for (const std::size_t joint : TRUNK) chest = multiply(chest, turns[joint]);
  return {pitch(chest), pitch(multiply(multiply(chest, turns[NECK]), turns[HEAD]))};
}

std::array<double, FRAMES> calmed(double& share, bool rests) {
  std::array<double, FRAMES> shares;
  for (double& eased : shares) {
    share = bounded(share + (rests ? CALMING : -LEAVING), 0, 1);
    eased = share * share * (3 - 2 * share);
  }
  return shares;
}

Looks hold(Looks before, std::array<Turns, FRAMES>& frames, const Habits& own, const std::array<double, FRAMES>& rest) {
  auto [lean, pitch] = before;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    Turns& turns = frames[t];
    const Looks now = looks(turns);
    lean += FOLLOW * (now.lean - lean);
    pitch += FOLLOW * (now.pitch - pitch);
    const double back = bounded(TRUNK_SHARE * (-lean - own.lean), 0, TRUNK_MOST);
    const double up = bounded(HEAD_SHARE * (own.level - pitch - back), -HEAD_MOST, HEAD_MOST);
    turns[SPINE] = multiply(about_x(back), turns[SPINE]);
    turns[NECK] = multiply(about_x(up / 2), turns[NECK]);
    turns[HEAD] = multiply(about_x(up / 2), turns[HEAD]);
    for (std::size_t side = 0; side < 2; ++side) arm(turns, side, own, HANGING - (lean + back), rest[t]);
  }
  return {lean, pitch};
}

}  // namespace wayfarer::local
