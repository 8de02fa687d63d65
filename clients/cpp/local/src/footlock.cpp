#include "footlock.hpp"

#include <map>

namespace wayfarer::local {
namespace {

constexpr double TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
constexpr double RISE = 1.0 / 3;
constexpr double SLIPPING[] = {0.25, LIFT_SPEED}, SWIVELLING[] = {2, 6}, TILTED[] = {0.01, 0.025}, LEASH[] = {0.09, 0.14};
constexpr double FADE = 1 / (0.15 * FPS);
constexpr double SETTLE = 0.25, DROP = 0.02, SOFTNESS = 0.006;

double smooth(double value, const double (&ends)[2]) { return local::smooth(value, ends[0], ends[1]); }

LegShare share_of_leg(const std::string& marker) {
  static const std::map<std::string, LegShare> KNOWN{{"THI", {0.5, 0}}, {"KNE", {1, 0}}, {"KNI", {1, 0}},
                                                     {"SHN", {0.5, 0.5}}, {"CLF", {0.5, 0.5}}, {"ANK", {0, 1}},
                                                     {"HEE", {0, 1}}, {"TOE", {0, 1}}, {"MT1", {0, 1}},
                                                     {"MT5", {0, 1}}, {"SOLE_HEEL", {0, 1}}, {"SOLE_MT1", {0, 1}},
                                                     {"SOLE_MT5", {0, 1}}, {"SOLE_TOE", {0, 1}}};
  const auto found = KNOWN.find(marker.substr(1));
  return found == KNOWN.end() ? LegShare{} : found->second;
}

// the point that bears: its way since the last frame, and its place
struct Bearing {
  Point way, at;
};

Bearing bearing(const Soles& before, const Soles& now) {
  const double height = lowest(now);
  Point way, at;
  double loads = 0;
  for (std::size_t p = 0; p < SOLES; ++p) {
    const double load = std::exp((height - now[p].z) / SOFTNESS);
    loads += load;
    way = way + load * floor_of(now[p] - before[p]);
    at = at + load * floor_of(now[p]);
  }
  return {(1 / loads) * way, (1 / loads) * at};
}

// from the heel to between the balls
Point along(const Soles& soles) { return floor_of(0.5 * (soles[1] + soles[2]) - soles[0]); }

// how far the end of an arm is moved that turns by `yaw`
Vec3 turned_off(double yaw, Point arm) {
  const double sine = std::sin(yaw), less_cosine = std::cos(yaw) - 1;
  return {less_cosine * arm.x - sine * arm.y, sine * arm.x + less_cosine * arm.y, 0};
}

// turn the markers of a seed frame's feet about their ankles
void turn_feet(const std::vector<Feet<LegShare>>& shares, const LegPose& pose, const Vec3& hips,
               const Feet<double>& yaws, std::size_t frame, Markers& markers) {
  for (std::size_t m = 0; m < shares.size(); ++m) {
    for (std::size_t side = 0; side < 2; ++side) {
      if (shares[m][side].ankle != 1) continue;
      Vec3& marker = markers[shares.size() * frame + m];
      marker = rounded(marker + turned_off(yaws[side], floor_of(marker - hips - pose.ankle[side])));
    }
  }
}

// let the markers of a seed frame follow legs that have been moved
void follow(const std::vector<Feet<LegShare>>& shares, const LegPose& from, const LegPose& to, std::size_t frame,
            Markers& markers) {
  for (std::size_t m = 0; m < shares.size(); ++m) {
    for (std::size_t side = 0; side < 2; ++side) {
      const auto [knee, ankle] = shares[m][side];
      if (knee == 0 && ankle == 0) continue;
      Vec3& marker = markers[shares.size() * frame + m];
      marker = rounded(marker + knee * (to.knee[side] - from.knee[side]) + ankle * (to.ankle[side] - from.ankle[side]));
    }
  }
}

}  // namespace

std::vector<Feet<LegShare>> leg_shares(const std::vector<std::string>& markers) {
  std::vector<Feet<LegShare>> shares;
  for (const std::string& marker : markers) {
    const bool left = marker[0] == 'L', right = marker[0] == 'R';
    shares.push_back({left ? share_of_leg(marker) : LegShare{}, right ? share_of_leg(marker) : LegShare{}});
  }
  return shares;
}

void lock_feet(const Legs& legs, const std::vector<Feet<LegShare>>& shares, const Seed& seed, Step& step) {
  const LegPose first(legs, seed.hips[0], seed.turns[0]), last(legs, seed.hips[1], seed.turns[1]);
  Feet<Soles> soles = last.soles;
  Feet<bool> contact;
  Feet<double> hold, yaw{};
  Feet<Vec3> shift, moved;
  for (std::size_t side = 0; side < 2; ++side) {
    const double speed = FPS * length(bearing(first.soles[side], soles[side]).way);
    contact[side] = lowest(soles[side]) < TOUCH_HEIGHT && speed < TOUCH_SPEED;
    hold[side] = contact[side];
  }
  for (std::size_t t = 0; t < FRAMES; ++t) {
    LegPose pose(legs, step.hips[t], step.turns[t]);
    for (std::size_t side = 0; side < 2; ++side) {
      const auto [way, at] = bearing(soles[side], pose.soles[side]);
      const double height = lowest(pose.soles[side]), speed = FPS * length(way);
      bool& touches = contact[side];
      touches = height < (touches ? LIFT_HEIGHT : TOUCH_HEIGHT) && speed < (touches ? LIFT_SPEED : TOUCH_SPEED);
      hold[side] = bounded(hold[side] + (touches ? RISE : -RISE), 0, 1);
      Vec3& off = shift[side];
      const double grip = hold[side] * (1 - smooth(speed, SLIPPING)) * (1 - smooth(length(floor_of(off)), LEASH));
      const double stays = 1 - (1 - grip) * FADE, settling = -height * (1 - local::smooth(height, 0, DROP));
      off = {stays * off.x - grip * way.x, stays * off.y - grip * way.y,
             off.z + SETTLE * (hold[side] * settling - off.z)};
      const Soles& now = pose.soles[side];
      const double swivel = turn_to(along(soles[side]), along(now)), tilt = std::abs(now[0].z - (now[1].z + now[2].z) / 2);
      const double firm = hold[side] * (1 - smooth(FPS * std::abs(swivel), SWIVELLING)) * (1 - smooth(tilt, TILTED));
      yaw[side] = (1 - (1 - firm) * FADE) * yaw[side] - firm * swivel;
      moved[side] = off + turned_off(yaw[side], floor_of(step.hips[t] + pose.ankle[side]) - at);
      pose.ankle_turn[side] = multiply(about_z(yaw[side]), pose.ankle_turn[side]);
      step.contacts[t][side] = touches && grip >= 0.5 && height + off.z <= TOLD_HEIGHT;
    }
    soles = pose.soles;
    move_ankles(pose, moved, step.turns[t]);
    if (t >= FRAMES - SEED) {
      turn_feet(shares, pose, step.hips[t], yaw, t - (FRAMES - SEED), step.markers);
      follow(shares, pose, LegPose(legs, step.hips[t], step.turns[t]), t - (FRAMES - SEED), step.markers);
    }
  }
}

}  // namespace wayfarer::local
