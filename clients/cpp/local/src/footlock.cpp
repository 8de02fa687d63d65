#include "footlock.hpp"

#include <map>

namespace wayfarer::local {
namespace {

constexpr double TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
constexpr double RISE = 1.0 / 3;
constexpr double SLIPPING[] = {0.25, LIFT_SPEED}, LEASH[] = {0.09, 0.14};
constexpr double FADE = 1 / (0.15 * FPS);
constexpr double SETTLE = 0.25, DROP = 0.02, SOFTNESS = 0.006;

double smooth(double value, const double (&ends)[2]) { return local::smooth(value, ends[0], ends[1]); }

LegShare share_of(const std::string& marker) {
  static const std::map<std::string, LegShare> KNOWN{{"THI", {0.5, 0}}, {"KNE", {1, 0}}, {"KNI", {1, 0}},
                                                     {"SHN", {0.5, 0.5}}, {"CLF", {0.5, 0.5}}, {"ANK", {0, 1}},
                                                     {"HEE", {0, 1}}, {"TOE", {0, 1}}, {"MT1", {0, 1}},
                                                     {"MT5", {0, 1}}, {"SOLE_HEEL", {0, 1}}, {"SOLE_MT1", {0, 1}},
                                                     {"SOLE_MT5", {0, 1}}, {"SOLE_TOE", {0, 1}}};
  const auto found = KNOWN.find(marker.substr(1));
  return found == KNOWN.end() ? LegShare{} : found->second;
}

// way of the bearing point since the last frame
Point slide(const Soles& before, const Soles& now) {
  const double height = lowest(now);
  Point way;
  double loads = 0;
  for (std::size_t p = 0; p < SOLES; ++p) {
    const double load = std::exp((height - now[p].z) / SOFTNESS);
    loads += load;
    way = way + load * floor_of(now[p] - before[p]);
  }
  return (1 / loads) * way;
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
    shares.push_back({left ? share_of(marker) : LegShare{}, right ? share_of(marker) : LegShare{}});
  }
  return shares;
}

void lock_feet(const Legs& legs, const std::vector<Feet<LegShare>>& shares, const Seed& seed, Step& step) {
  const LegPose first(legs, seed.hips[0], seed.turns[0]), last(legs, seed.hips[1], seed.turns[1]);
  Feet<Soles> soles = last.soles;
  Feet<bool> contact;
  Feet<double> hold;
  Feet<Vec3> shift;
  for (std::size_t side = 0; side < 2; ++side) {
    const double speed = FPS * length(slide(first.soles[side], soles[side]));
    contact[side] = lowest(soles[side]) < TOUCH_HEIGHT && speed < TOUCH_SPEED;
    hold[side] = contact[side];
  }
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const LegPose pose(legs, step.hips[t], step.turns[t]);
    for (std::size_t side = 0; side < 2; ++side) {
      const Point way = slide(soles[side], pose.soles[side]);
      const double height = lowest(pose.soles[side]), speed = FPS * length(way);
      bool& touches = contact[side];
      touches = height < (touches ? LIFT_HEIGHT : TOUCH_HEIGHT) && speed < (touches ? LIFT_SPEED : TOUCH_SPEED);
      hold[side] = bounded(hold[side] + (touches ? RISE : -RISE), 0, 1);
      Vec3& off = shift[side];
      const double grip = hold[side] * (1 - smooth(speed, SLIPPING)) * (1 - smooth(length(floor_of(off)), LEASH));
      const double stays = 1 - (1 - grip) * FADE, settling = -height * (1 - local::smooth(height, 0, DROP));
      off = {stays * off.x - grip * way.x, stays * off.y - grip * way.y,
             off.z + SETTLE * (hold[side] * settling - off.z)};
      step.contacts[t][side] = touches && grip >= 0.5 && height + off.z <= TOLD_HEIGHT;
    }
    soles = pose.soles;
    move_ankles(pose, shift, step.turns[t]);
    if (t >= FRAMES - SEED)
      follow(shares, pose, LegPose(legs, step.hips[t], step.turns[t]), t - (FRAMES - SEED), step.markers);
  }
}

}  // namespace wayfarer::local
