#include "footlock.hpp"

namespace wayfarer::local {
namespace {

constexpr double TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
constexpr double RISE = 1.0 / 3;
constexpr double SLIPPING[] = {0.25, LIFT_SPEED}, LEASH[] = {0.09, 0.14};
constexpr double FADE = 1 / (0.15 * FPS);
constexpr double SETTLE = 0.25, DROP = 0.02, SOFTNESS = 0.001;

double smooth(double value, const double (&ends)[2]) { return local::smooth(value, ends[0], ends[1]); }

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

}  // namespace

FootLock::State FootLock::begin(const Vec3& hips, const Turns& turns) const {
  State state;
  state.soles = LegPose(legs_, hips, turns).soles;
  for (std::size_t side = 0; side < 2; ++side) {
    state.contact[side] = lowest(state.soles[side]) < TOUCH_HEIGHT;
    state.hold[side] = state.contact[side];
  }
  return state;
}

Contacts FootLock::clean(const FrameHips& hips, FrameTurns& turns) {
  if (!state_) state_ = begin(hips[0], turns[0]);
  State& state = *state_;
  Contacts contacts;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const LegPose pose(legs_, hips[t], turns[t]);
    for (std::size_t side = 0; side < 2; ++side) {
      const Point way = slide(state.soles[side], pose.soles[side]);
      const double height = lowest(pose.soles[side]), speed = FPS * length(way);
      bool& contact = state.contact[side];
      contact = height < (contact ? LIFT_HEIGHT : TOUCH_HEIGHT) && speed < (contact ? LIFT_SPEED : TOUCH_SPEED);
      double& hold = state.hold[side];
      hold = bounded(hold + (contact ? RISE : -RISE), 0, 1);
      Vec3& shift = state.shift[side];
      const double grip = hold * (1 - smooth(speed, SLIPPING)) * (1 - smooth(length(floor_of(shift)), LEASH));
      const double stays = 1 - (1 - grip) * FADE, settling = -height * (1 - local::smooth(height, 0, DROP));
      shift = {stays * shift.x - grip * way.x, stays * shift.y - grip * way.y,
               shift.z + SETTLE * (hold * settling - shift.z)};
      contacts[t][side] = contact && grip >= 0.5 && height + shift.z <= TOLD_HEIGHT;
    }
    state.soles = pose.soles;
    move_ankles(pose, state.shift, turns[t]);
  }
  return contacts;
}

}  // namespace wayfarer::local
