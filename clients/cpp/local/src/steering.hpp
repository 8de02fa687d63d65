// Chooses what a person does next: stand, walk, stop, turn, or step sideways. It mirrors the server's
// world/goals/steering.py, for one person.
#pragma once

#include <map>
#include <string>

#include "geometry.hpp"
#include "wayfarer/local.hpp"

namespace wayfarer::local {

enum Mode { STANDING, WALKING, STOPPING, TURNING, STRAFING };
inline constexpr const char* MODES[] = {"STANDING", "WALKING", "STOPPING", "TURNING", "STRAFING"};

/// The state from step to step.
struct Gait {
  Mode mode = STANDING;
  double speed = 0, slow_seconds = 0;  // m/s over the last step
  Point stop_place, stop_facing;
  bool arrived = false;
  int waypoint = 0;
  double trim = 0;
  bool rested = true;  // it stood when the step began
};

/// A goal on a path, as steering has it.
struct GoalRow {
  bool given = false;
  Point place;
  double radius = 0, speed = 0;
  bool has_heading = false;
  Point heading;  // unit vector to face
  bool strafe = false, through = false;
  double dwell = 0;
  bool more = false;
  double bend = 0;  // radians
  Point onward;
};

/// The rows of a path that is walked from `start`.
std::vector<GoalRow> goal_rows(const std::vector<LocalGoal>& goals, Point start);
/// The goal at a place of a path; beyond its end, a goal that is not given.
GoalRow goal_at(const std::vector<GoalRow>& rows, int waypoint);

/// Hips and facing where a step starts; `first`: hips in the first frame of the seed.
struct Start {
  Point hips, first, facing;
};

/// The target of the next step.
struct Targets {
  Point place, facing;
  double speed = 0;
};

/// The rules, with the constants of an export's sidecar.
class Steering {
 public:
  /// Throws std::runtime_error where a constant is missing.
  explicit Steering(const std::map<std::string, double>& constants);

  int reactions = 0;

  /// Sends a person that is done with a goal on to the next.
  Gait advance(Gait gait, const GoalRow& goal) const;
  /// The gait of the next step. `ready`: a waiting person may set off.
  Gait decide(Gait gait, const Start& start, const GoalRow& goal, bool ready) const;
  Targets targets(const Gait& gait, const Start& start, const GoalRow& goal) const;

 private:
  double braking_seconds_, braking_margin_, coasting_seconds_, pausing_, slow_, slow_seconds_, resume_margin_, lookahead_,
      lookahead_seconds_, faced_, astray_, turn_radius_, turn_speed_, strafe_speed_, strafe_slowest_, weight_shift_;

  Point ahead(const Start& start, const GoalRow& goal) const;
  Point rest(const Gait& gait, const Start& start) const;
};

/// The gait after a step.
Gait observe(Gait gait, Point start, const std::array<Vec3, FRAMES>& hips, const GoalRow& goal);

}  // namespace wayfarer::local
