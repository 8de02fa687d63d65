#include "steering.hpp"

#include <stdexcept>

namespace wayfarer::local {
namespace {

constexpr double TRIM_GAIN = 0.12, TRIM_MOST = 0.15, STEADY = 0.3;
constexpr double HURRY[] = {1.6, 2.0};     // m/s between which habits of stride go to nothing
constexpr double STRIDE[] = {-0.05, 0.11};  // range of the share by which steps are shorter
constexpr double SHORTEN_RATE = 0.6 * STEP_SECONDS;

double between(Point a, Point b) { return std::acos(bounded(dot(a, b), -1, 1)); }

}  // namespace

std::vector<GoalRow> goal_rows(const std::vector<LocalGoal>& goals, Point start) {
  std::vector<GoalRow> rows;
  std::vector<Point> ways;
  Point from = start;
  for (const LocalGoal& goal : goals) {
    ways.push_back(unit(Point{goal.x, goal.y} - from));
    from = {goal.x, goal.y};
  }
  for (std::size_t k = 0; k < goals.size(); ++k) {
    const LocalGoal& goal = goals[k];
    const bool more = k + 1 < goals.size();
    GoalRow row;
    row.given = true;
    row.place = {goal.x, goal.y};
    row.radius = goal.radius;
    row.speed = goal.speed;
    row.has_heading = goal.heading.has_value();
    if (goal.heading) row.heading = {-std::sin(*goal.heading), std::cos(*goal.heading)};
    row.strafe = goal.strafe;
    row.through = !goal.stop;
    row.dwell = goal.dwell;
    row.more = more;
    row.onward = more ? ways[k + 1] : ways[k];
    row.bend = between(ways[k], row.onward);
    rows.push_back(row);
  }
  return rows;
}

GoalRow goal_at(const std::vector<GoalRow>& rows, int waypoint) {
  const auto k = static_cast<std::size_t>(waypoint);
  return k < rows.size() ? rows[k] : GoalRow{};
}

Steering::Steering(const std::map<std::string, double>& constants) {
  const auto read = [&](const char* name) {
    const auto found = constants.find(name);
    if (found == constants.end())
      throw std::runtime_error(std::string("wayfarer.json: steering has no ") + name +
                               "; write it again: wayfarer export --for engines");
    return found->second;
  };
  braking_seconds_ = read("braking_seconds");
  braking_margin_ = read("braking_margin");
  slowing_distance_ = read("slowing_distance");
  slowest_ = read("slowest");
  acceleration_ = read("acceleration");
  coasting_seconds_ = read("coasting_seconds");
  sharp_ = read("sharp");
  corner_speed_ = read("corner_speed");
  pausing_ = read("pausing");
  slow_ = read("slow");
  slow_seconds_ = read("slow_seconds");
  resume_margin_ = read("resume_margin");
  lookahead_ = read("lookahead");
  behind_ = read("behind");
  abeam_ = read("abeam");
  faced_ = read("faced");
  astray_ = read("astray");
  turn_ahead_ = read("turn_ahead");
  reactions = static_cast<int>(read("reactions"));
  side_step_speed_ = read("side_step_speed");
  side_step_acceleration_ = read("side_step_acceleration");
  side_step_faced_ = read("side_step_faced");
}

Gait Steering::advance(Gait gait, const GoalRow& goal) const {
  const bool dwelt = gait.slow_seconds >= slow_seconds_ + goal.dwell - 1e-3;
  const bool done = goal.through || (gait.mode == STANDING && dwelt);
  if (goal.more && gait.arrived && done) {
    gait.mode = WALKING;
    gait.slow_seconds = 0;
    gait.arrived = false;
    gait.waypoint += 1;
  }
  return gait;
}

Gait Steering::decide(Gait gait, const Start& start, const GoalRow& goal, bool ready) const {
  const Mode mode = gait.mode;
  const Point way = goal.place - start.hips;
  const double distance = length(way);
  const double braking = std::min(goal.radius / 2, braking_margin_) + braking_seconds_ * gait.speed;
  const bool walking = mode == WALKING || mode == STRAFING, stopping = mode == STOPPING;
  const bool standing = mode == STANDING, turning = mode == TURNING;

  const bool is_slow = gait.speed < slow_;
  const double slow_seconds = standing || (stopping && is_slow) ? gait.slow_seconds + STEP_SECONDS : 0;
  const bool still = stopping && slow_seconds >= slow_seconds_ - 1e-3;

  const bool holds = goal.given && !(goal.through && gait.arrived);
  const bool paused = mode == WALKING && gait.speed < pausing_ * std::min(goal.speed, slowest_);
  const bool far = distance > braking && !(gait.arrived && (is_slow || paused));
  const bool at_rest = still || standing || turning || (walking && is_slow);
  const bool waits = !ready && gait.planted && is_slow && (standing || mode == WALKING);
  const bool missed = holds && !gait.arrived && !waits;
  const bool strayed = holds && distance > std::max(goal.radius, braking) + resume_margin_ && !waits;

  const Point direction = (1 / std::max(distance, 1e-6)) * way;
  const bool reverses =
      missed && far && between(start.facing, direction) > (turning ? abeam_ : behind_) && !goal.strafe;
  const bool about = reverses && (at_rest || is_slow);
  bool walks = ((walking && holds && (goal.through || far) && !waits) || ((still || standing || turning) && missed) ||
                (!walking && strayed)) &&
               !reverses;
  const bool has_heading = goal.has_heading && !waits;
  const double off = between(start.facing, goal.heading);
  const bool astray = has_heading && off > (turning ? faced_ : astray_);
  const bool faces = off < (turning ? faced_ : side_step_faced_);
  const bool side_steps = walks && goal.strafe && (mode == STRAFING || (at_rest && faces));
  const bool turns_first = walks && goal.strafe && at_rest && !side_steps;
  const bool stops_first = walks && goal.strafe && !at_rest && !side_steps;
  walks = walks && !(turns_first || stops_first);
  const bool turns = about || turns_first || (at_rest && astray && !walks);
  const bool stands = waits || ((standing || still) && !walks && !turns);
  const Mode next = side_steps ? STRAFING : walks ? WALKING : turns ? TURNING : stands ? STANDING : STOPPING;

  const bool brakes = walking && !walks && !waits, rests = still && !walks;
  const bool turns_away = (about || turns_first) && !turning;
  if (turns && holds && gait.arrived && !about && !turns_first)
    gait.stop_place = goal.place;  // its steps take it nearer
  else if (rests || turns_away)
    gait.stop_place = start.hips;
  else if (brakes)
    gait.stop_place = holds && !reverses && !stops_first ? goal.place : rest(gait, start);
  if (about)
    gait.stop_facing = direction;
  else if (has_heading && !walks)
    gait.stop_facing = goal.heading;
  else if (brakes || rests)
    gait.stop_facing = start.facing;
  gait.mode = next;
  gait.slow_seconds = slow_seconds;
  gait.planted = gait.planted && next != WALKING && next != TURNING;
  return gait;
}

Targets Steering::targets(const Gait& gait, const Start& start, const GoalRow& goal) const {
  switch (gait.mode) {
    case WALKING:
      return {ahead(start, goal), {}, speed(gait, start, goal)};
    case STRAFING:
      return {start.hips, goal.heading, 0};
    case TURNING: {
      const double angle = bounded(turn_to(start.facing, gait.stop_facing), -turn_ahead_, turn_ahead_);
      return {gait.stop_place, turned(start.facing, angle), 0};
    }
    default:
      return {gait.stop_place, gait.stop_facing, 0};
  }
}

Point Steering::carried(const Gait& gait, const Start& start, const GoalRow& goal) const {
  const Point way = ahead(start, goal) - start.hips;
  const double distance = length(way);
  const double target = std::min(goal.speed, side_step_speed_);
  const double slowing = goal.through ? target : distance / (2 * STEP_SECONDS);
  const double wanted = gait.mode == STRAFING ? std::min(target, slowing) : 0;
  const Point change = (wanted / std::max(distance, 1e-6)) * way - gait.carried;
  const double most = side_step_acceleration_ * STEP_SECONDS;
  return gait.carried + std::min(1.0, most / std::max(length(change), 1e-9)) * change;
}

Point Steering::ahead(const Start& start, const GoalRow& goal) const {
  if (!goal.through) return goal.place;
  const double distance = length(goal.place - start.hips);
  return goal.place + std::max(lookahead_ * std::cos(goal.bend) - distance, 0.0) * goal.onward;
}

double Steering::speed(const Gait& gait, const Start& start, const GoalRow& goal) const {
  const double distance = length(goal.place - start.hips);
  const double habit = bounded(gait.shortened, STRIDE[0], STRIDE[1]);
  const double target = goal.speed * (1 + gait.trim) / (1 - habit);
  const double at_goal = !goal.through ? slowest_ : goal.bend > sharp_ ? corner_speed_ : target;
  const double slowing = target * distance / slowing_distance_;
  const double reachable = gait.speed / (1 - gait.shortened) + acceleration_ * STEP_SECONDS / (1 - habit);
  return std::min({target, reachable, std::max(slowing, at_goal)});
}

// where a person who begins to brake now comes to rest
Point Steering::rest(const Gait& gait, const Start& start) const {
  return start.hips + coasting_seconds_ * gait.speed * unit(start.hips - start.first);
}

Gait shortened_gait(Gait gait, const GoalRow& goal, double stride) {
  const double calm = bounded((HURRY[1] - goal.speed) / (HURRY[1] - HURRY[0]), 0, 1);
  const double habit = (STRIDE[0] + (STRIDE[1] - STRIDE[0]) * stride) * calm;
  const double wanted = gait.mode == WALKING || gait.mode == STOPPING ? habit : 0;
  gait.shortened = rounded(gait.shortened + bounded(wanted - gait.shortened, -SHORTEN_RATE, SHORTEN_RATE));
  return gait;
}

Gait observe(Gait gait, Point start, const std::array<Vec3, FRAMES>& hips, const GoalRow& goal) {
  if (goal.given)
    for (const Vec3& place : hips) gait.arrived |= length(floor_of(place) - goal.place) <= goal.radius;
  gait.speed = length(floor_of(hips.back()) - start) / STEP_SECONDS;
  const double lacks = 1 - gait.speed / std::max(goal.speed, 1e-3);
  const bool steady =
      goal.given && gait.mode == WALKING && gait.shortened <= rounded(STRIDE[1]) && std::abs(lacks) < STEADY;
  gait.trim = bounded(gait.trim + (steady ? TRIM_GAIN * lacks : 0), -TRIM_MOST, TRIM_MOST);
  return gait;
}

}  // namespace wayfarer::local
