#include "legs.hpp"

namespace wayfarer::local {
namespace {

constexpr std::size_t HIPS[] = {1, 2}, ANKLES[] = {7, 8}, BALLS[] = {10, 11};
constexpr double STRETCH = 0.999, FOLD = 0.3, TINY = 1e-9, SOFT = PI / 45, FREE = 0.5;
constexpr Vec3 LEFT{-1, 0, 0};

Quat relative(const Quat& parent, const Quat& turn) { return multiply(inverse(parent), turn); }

// distance from hip to ankle that a leg takes when it is `wanted`
double reach(double before, double wanted, double leg) {
  const double way = STRETCH * leg - before, more = wanted - before;
  const double near = std::max(FREE * way, 1e-6), rest = std::max((1 - FREE) * way, 1e-6);
  const double eased = std::min(more, near) + rest * (1 - std::exp(-std::max(more - near, 0.0) / rest));
  return std::max(before + eased, std::min(before, FOLD * leg));
}

void move_ankle(const LegPose& pose, std::size_t side, const Vec3& shift, Turns& turns) {
  const Vec3 thigh = pose.knee[side] - pose.hip[side], shin = pose.ankle[side] - pose.knee[side];
  const Vec3 target = pose.ankle[side] + shift - pose.hip[side];
  // a shin turned by an angle about the hinge has thigh · shin = along + most · cos(angle + bend)
  const Vec3 hinge = rotate(pose.hip_turn[side], LEFT);
  const double along = dot(thigh, hinge) * dot(shin, hinge);
  const double level = dot(thigh, shin) - along, upright = dot(cross(thigh, shin), hinge);
  const double most = std::max(std::hypot(level, upright), TINY);
  const double fixed = dot(thigh, thigh) + dot(shin, shin) + 2 * along;
  const double full = std::sqrt(std::max(fixed + 2 * most, TINY)), far = length(target);
  const double after = reach(length(pose.ankle[side] - pose.hip[side]), far, full);
  double bent = std::acos(bounded((after * after - fixed) / (2 * most), -1, 1));
  const double soft = std::max(2 * SOFT - bent, 0.0);
  bent += soft * soft / (4 * SOFT);
  const double half = 0.5 * (bent - std::atan2(upright, level)), sine = std::sin(half);
  const Quat bend{hinge.x * sine, hinge.y * sine, hinge.z * sine, std::cos(half)};

  // the shortest arc that swings the bent leg onto its target
  const Vec3 ankle_to = thigh + rotate(bend, shin), about = cross(ankle_to, target);
  const Quat swing = unit(Quat{about.x, about.y, about.z, dot(ankle_to, target) + length(ankle_to) * far + TINY});
  const Quat hip = multiply(swing, pose.hip_turn[side]);
  const Quat knee = multiply(swing, multiply(bend, pose.knee_turn[side]));
  turns[HIPS[side]] = relative(pose.root, hip);
  turns[KNEES[side]] = relative(hip, knee);
  turns[ANKLES[side]] = relative(knee, pose.ankle_turn[side]);
}

}  // namespace

void Legs::measure() {
  double down = 0, soles = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    length[side] = wayfarer::length(knee[side]) + wayfarer::length(ankle[side]);
    down += (hip[side].z + knee[side].z + ankle[side].z) / 2;
    soles += sole_of_ankle[side][0].z / 2;
  }
  standing = -down - soles;
}

LegPose::LegPose(const Legs& legs, const Vec3& hips, const Turns& turns) : root(turns[0]), facing(facing_of(turns[0])) {
  for (std::size_t side = 0; side < 2; ++side) {
    hip[side] = rotate(root, legs.hip[side]);
    hip_turn[side] = multiply(root, turns[HIPS[side]]);
    knee[side] = hip[side] + rotate(hip_turn[side], legs.knee[side]);
    knee_turn[side] = multiply(hip_turn[side], turns[KNEES[side]]);
    ankle[side] = knee[side] + rotate(knee_turn[side], legs.ankle[side]);
    ankle_turn[side] = multiply(knee_turn[side], turns[ANKLES[side]]);
    const Quat ball_turn = multiply(ankle_turn[side], turns[BALLS[side]]);
    const Vec3 place = hips + ankle[side], ball = rotate(ankle_turn[side], legs.ball[side]);
    for (std::size_t p = 0; p < SOLES; ++p)
      soles[side][p] = place + legs.ball_share[side][p] * ball +
                       rotate(ankle_turn[side], legs.sole_of_ankle[side][p]) +
                       rotate(ball_turn, legs.sole_of_ball[side][p]);
  }
}

void move_ankles(const LegPose& pose, const Feet<Vec3>& shifts, Turns& turns) {
  for (std::size_t side = 0; side < 2; ++side) move_ankle(pose, side, shifts[side], turns);
}

double lowest(const Soles& soles) {
  return std::min({soles[0].z, soles[1].z, soles[2].z, soles[3].z});
}

}  // namespace wayfarer::local
