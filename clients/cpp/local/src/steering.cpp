#include "steering.hpp"

#include <stdexcept>

namespace wayfarer::local {
namespace {

constexpr double TRIM_GAIN = 0.12, TRIM_MOST = 0.15, STEADY = 0.3, GONE_BY = 0.2, FARTHER = 1.5;
constexpr double PACE = 0.7;  // m/s: nobody who walks to a goal is slower before its end, unless that is asked
constexpr double SHIFTS[] = {13, 21}, CALM = 4;  // seconds: when a standing body shifts its weight, how soon in full

double between(Point a, Point b) { return std::acos(bounded(dot(a, b), -1, 1)); }

// where its weight is, from -1 (left) to 1 (right), of a body that stands
double leans(Point place, double seconds) {
  const double own = 10 * (place.x + 2 * place.y);
  const double wave = std::sin(2 * PI * seconds / SHIFTS[0] + own) + std::sin(2 * PI * seconds / SHIFTS[1] + 3 * own);
  return std::min(seconds / CALM, 1.0) * std::tanh(2 * wave);
}

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
  coasting_seconds_ = read("coasting_seconds");
  pausing_ = read("pausing");
  slow_ = read("slow");
  slow_seconds_ = read("slow_seconds");
  resume_margin_ = read("resume_margin");
  lookahead_ = read("lookahead");
  lookahead_seconds_ = read("lookahead_seconds");
  faced_ = read("faced");
  astray_ = read("astray");
  reactions = static_cast<int>(read("reactions"));
  turn_radius_ = read("turn_radius");
  turn_speed_ = read("turn_speed");
  strafe_speed_ = read("strafe_speed");
  strafe_slowest_ = read("strafe_slowest");
  weight_shift_ = read("weight_shift");
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
  const bool paused = mode == WALKING && gait.speed < pausing_ * std::min(goal.speed, PACE);
  const bool at_rest = still || standing || turning || (walking && is_slow);
  const bool waits = !ready && gait.rested && is_slow && (standing || mode == WALKING);
  const bool missed = holds && !gait.arrived && !waits;
  const bool strayed = holds && distance > std::max(goal.radius, braking) + resume_margin_ && !waits;
  const bool far = distance > braking && (strayed || !(gait.arrived && (is_slow || paused)));

  const bool walks = (walking && holds && (goal.through || far) && !waits) ||
                     ((still || standing || turning) && missed) || (!walking && strayed);
  const bool has_heading = goal.has_heading && !waits;
  const double off = between(start.facing, goal.heading);
  const bool astray = has_heading && off > (turning ? faced_ : astray_);
  const bool turns = at_rest && astray && !walks;
  const bool stands = waits || ((standing || still) && !walks && !turns);
  const Mode next = walks && goal.strafe ? STRAFING : walks ? WALKING : turns ? TURNING : stands ? STANDING : STOPPING;

  const bool brakes = walking && !walks && !waits, rests = still && !walks;
  if (turns && holds && gait.arrived)
    gait.stop_place = goal.place;  // its steps take it nearer
  else if (rests && holds && distance > goal.radius / 2)
    gait.stop_place = goal.place;  // it would sway out of reach
  else if (rests || (turning && !turns))
    gait.stop_place = start.hips;
  else if (brakes)
    gait.stop_place = holds ? goal.place : rest(gait, start);
  if (has_heading && !walks)
    gait.stop_facing = goal.heading;
  else if (brakes || rests)
    gait.stop_facing = start.facing;
  gait.mode = next;
  gait.slow_seconds = slow_seconds;
  gait.rested = stands;
  return gait;
}

Targets Steering::targets(const Gait& gait, const Start& start, const GoalRow& goal) const {
  if (gait.mode == TURNING) {
    const Point arc = start.facing + gait.stop_facing;
    return {gait.stop_place + turn_radius_ / std::max(length(arc), 0.1) * arc, gait.stop_facing, turn_speed_};
  }
  if (gait.mode != WALKING && gait.mode != STRAFING) {
    const double aside = gait.mode == STANDING ? weight_shift_ * leans(gait.stop_place, gait.slow_seconds) : 0;
    return {gait.stop_place + aside * Point{gait.stop_facing.y, -gait.stop_facing.x}, gait.stop_facing, 0};
  }
  const double asked = goal.speed * (1 + gait.trim);
  const double speed = goal.strafe ? bounded(asked, strafe_slowest_, strafe_speed_) : asked;
  const Point facing = gait.mode == STRAFING ? goal.heading : Point{};
  return {ahead(start, goal), facing, speed};
}

Point Steering::ahead(const Start& start, const GoalRow& goal) const {
  const Point to = goal.place - start.hips;
  const double distance = length(to);
  if (!goal.through || dot(to, goal.onward) <= 0) return goal.place;  // who is past it has missed it, and turns back
  const double lookahead = std::max(lookahead_, lookahead_seconds_ * goal.speed);
  const double beyond = std::max(lookahead * std::cos(goal.bend) - distance, 0.0);
  return start.hips + FARTHER * (to + beyond * goal.onward);  // a body slows down before its goal
}

// where a person who begins to brake now comes to rest
Point Steering::rest(const Gait& gait, const Start& start) const {
  return start.hips + coasting_seconds_ * gait.speed * unit(start.hips - start.first);
}

Gait observe(Gait gait, Point start, const std::array<Vec3, FRAMES>& hips, const GoalRow& goal) {
  const bool walks = gait.mode == WALKING || gait.mode == STRAFING;
  if (goal.given) {
    double away = length(start - goal.place);
    for (const Vec3& place : hips) {
      const double before = away;
      away = length(floor_of(place) - goal.place);
      gait.arrived |= away <= goal.radius + (goal.through && walks && away > before ? GONE_BY : 0);
    }
  }
  gait.speed = length(floor_of(hips.back()) - start) / STEP_SECONDS;
  const double lacks = 1 - gait.speed / std::max(goal.speed, 1e-3);
  const bool steady = goal.given && walks && std::abs(lacks) < STEADY;
  gait.trim = bounded(gait.trim + (steady ? TRIM_GAIN * lacks : 0), -TRIM_MOST, TRIM_MOST);
  return gait;
}

}  // namespace wayfarer::local
