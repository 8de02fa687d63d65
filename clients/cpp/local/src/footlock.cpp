#include "footlock.hpp"

namespace wayfarer::local {
namespace {

constexpr double TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
constexpr double RISE = 1.0 / 3;
constexpr double SLIPPING[] = {0.25, LIFT_SPEED}, LEASH[] = {0.07, 0.1};
constexpr double FADE = 1 / (0.15 * FPS);
constexpr double SETTLE = 0.25, DROP = 0.02;
constexpr int STEP_FRAMES = 12;
constexpr double STEP_HEIGHT = 0.05, FLIGHT[] = {0.15, 0.85};
constexpr double STEP_SHIFT = 0.05, STEP_TURN = 24 * DEGREE, STEP_AHEAD = 0.15, AHEAD_SHIFT = 0.1,
                 AHEAD_TURN = 20 * DEGREE;
constexpr double AIM = 0.2, TIDY = 0.8, PATIENT = 1.6, LEADING = 0.25, APART = 0.11, RESTING[] = {0.03, 12 * DEGREE};
constexpr double RAISED = 0.006, LOWERED = 0.013, STRAIGHTENED = 0.85;
constexpr double KICK = 0.485, KICKED[] = {0.05, 0.22}, SPARED = 0.5, CLEAR[] = {TOLD_HEIGHT, 0.08};
constexpr double AIRBORNE[] = {0, 0.15}, SWAY = 0.016, SURGE = 0.009, AMPLE = 0.5, LONG[] = {0.66, 0.8}, STILL = 0.6;
constexpr double EVEN = 1 / (1.3 * FPS), EVEN_MOST = 0.05, FORGET = 0.025 / FPS;
constexpr double CLOSE = 0.2, WIDE = 0.75, SOFTNESS = 0.001;
constexpr double SIDES[] = {1, -1};

double smooth(double value, const double (&ends)[2]) { return local::smooth(value, ends[0], ends[1]); }

// the share of the shift of a step that is left when it still takes `frames`
double left_of(int frames) { return smooth(double(frames) / STEP_FRAMES, FLIGHT); }

// whether a foot that steps flies in this frame, and the share of its shift that stays in the next one
std::optional<double> flight(int frames) {
  const double left = left_of(frames), later = frames ? left_of(frames - 1) : 0;
  if (!(left > 0 && later < 1)) return std::nullopt;
  return later / std::max(left, 1e-6);
}

double lift(int frames) { return STEP_HEIGHT * std::pow(std::sin(PI * frames / STEP_FRAMES), 2); }

// where a foot that steps now is to land, ahead of the model: x, y and turn
Vec3 landing(Point way, double turning) {
  const double ahead = STEP_AHEAD * FPS;
  const double share = ahead * std::min(1.0, AHEAD_SHIFT / std::max(ahead * length(way), 1e-9));
  return {share * way.x, share * way.y, bounded(ahead * turning, -AHEAD_TURN, AHEAD_TURN)};
}

// landings at which no foot comes nearer to the other than `APART`
Feet<Vec3> uncrossed(Feet<Vec3> goals, const Feet<Vec3>& shift, double between, Point across) {
  const auto over = [&](const Vec3& a, const Vec3& b) {
    return std::max(APART - between - dot(floor_of(a - b), across), 0.0);
  };
  const double left = over(shift[1], goals[0]), right = over(goals[1], shift[0]);
  goals[0] = goals[0] - Vec3{left * across.x, left * across.y, 0};
  goals[1] = goals[1] + Vec3{right * across.x, right * across.y, 0};
  return goals;
}

// bears the body: 1, and less in the air
double borne(double left, double right) { return 1 - smooth(std::min(left, right), AIRBORNE); }

}  // namespace

FootLock::State FootLock::begin(const Vec3& hips, const Turns& turns) const {
  State state;
  state.soles = LegPose(legs_, hips, turns).soles;
  state.shortened = shortened_;
  for (std::size_t side = 0; side < 2; ++side) {
    state.contact[side] = lowest(state.soles[side]) < TOUCH_HEIGHT;
    state.hold[side] = state.contact[side];
  }
  return state;
}

FootLock::Poses FootLock::poses(const FrameHips& hips, const FrameTurns& turns) const {
  Poses found;
  for (std::size_t t = 0; t < FRAMES; ++t) found[t] = LegPose(legs_, hips[t], turns[t]);
  return found;
}

FootLock::Drawn FootLock::draw_in(const Poses& poses, State& state, bool steps, double shortened, bool evens) {
  Drawn drawn{};
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const LegPose& pose = poses[t];
    auto& along = drawn.along[t];
    for (std::size_t side = 0; side < 2; ++side) along[side] = dot(floor_of(pose.ankle[side]), pose.facing);
    if (evens) {
      const double lead = along[0] - along[1];
      state.reach = {std::max(state.reach[0] - FORGET, lead), std::max(state.reach[1] - FORGET, -lead)};
      drawn.stride[t] = (state.reach[0] + state.reach[1]) / 2;
      const double wanted = bounded((state.reach[1] - state.reach[0]) / 4, -EVEN_MOST, EVEN_MOST);
      state.evened += (steps ? 0 : EVEN) * (wanted - state.evened);
    }
    const double share = state.shortened + double(t + 1) / FRAMES * (shortened - state.shortened);
    for (std::size_t side = 0; side < 2; ++side)
      drawn.way[t][side] = (SIDES[side] * state.evened - share * along[side]) * pose.facing;
  }
  return drawn;
}

FootLock::Slides FootLock::slides(const Poses& poses, const Feet<Soles>& before, bool steps) {
  Slides found;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    for (std::size_t side = 0; side < 2; ++side) {
      const Soles &now = poses[t].soles[side], &old = t ? poses[t - 1].soles[side] : before[side];
      Slide& foot = found[t][side];
      foot.height = lowest(now);
      Point way, mean;
      double loads = 0;
      for (std::size_t p = 0; p < SOLES; ++p) {
        const double load = std::exp((foot.height - now[p].z) / SOFTNESS);
        const Point step = floor_of(now[p] - old[p]);
        loads += load;
        way = way + load * step;
        mean = mean + (1.0 / SOLES) * step;
      }
      foot.speed = FPS * length(way) / loads;
      foot.way = steps ? mean : (1 / loads) * way;
      foot.turn = turn_to(floor_of(old.back() - old.front()), floor_of(now.back() - now.front()));
    }
  }
  return found;
}

// one foot sets out on a step if it is due
void FootLock::set_out(State& state, bool steps, double bound, Point across) {
  const auto error = [&](std::size_t side) {
    return std::max(length(floor_of(state.shift[side])) / STEP_SHIFT, std::abs(state.turn[side]) / STEP_TURN);
  };
  const double lag = dot(floor_of(state.shift[0] + state.shift[1]), across) / STEP_SHIFT;
  const double to_left = lag - (state.turn[0] + state.turn[1]) / STEP_TURN;
  const std::size_t first = error(0) + (to_left > 0 ? LEADING : -LEADING) >= error(1) ? 0 : 1;
  const bool free = steps && state.contact[0] && state.contact[1] && state.swing[0] == 0 && state.swing[1] == 0;
  if (free && error(first) > bound) state.swing[first] = STEP_FRAMES;
}

// Lowers the hips over feet that are apart, and heels that are kicked up. Adds to `shifts`; returns how far.
double FootLock::sink(const LegPose& pose, const Feet<Point>& drawn, const Vec3& hips, const Feet<Slide>& feet,
                      double upright, Feet<Vec3>& shifts) const {
  const double bears = borne(feet[0].height, feet[1].height);
  const auto spare = [&](std::size_t side, const Vec3& off = {}) {
    return legs_.length[side] - length(pose.ankle[side] + off - pose.hip[side]);
  };
  const auto placed = [&](std::size_t side) {
    return spare(side, {shifts[side].x + drawn[side].x, shifts[side].y + drawn[side].y, 0});
  };
  const Point apart = floor_of(pose.ankle[0]) + drawn[0] - floor_of(pose.ankle[1]) - drawn[1];
  const double wide = (bounded(dot(apart, apart), CLOSE * CLOSE, WIDE * WIDE) - CLOSE * CLOSE) /
                      (WIDE * WIDE - CLOSE * CLOSE);
  const double walking = LOWERED * wide - std::min(RAISED, std::min(spare(0), spare(1)) / 2) * (1 - wide);
  const double straight = -STRAIGHTENED * std::max(std::min(placed(0), placed(1)), 0.0);
  const double sunk = (walking + upright * (straight - walking)) * bears;
  for (std::size_t side = 0; side < 2; ++side) {
    const double ankle = pose.ankle[side].z + hips.z, low = KICKED[0], high = KICKED[1];
    const double over = bounded(ankle - low, 0, high - low);
    const double raised = over * over / (2 * (high - low)) + std::max(ankle - high, 0.0);
    const double kick = std::min(KICK * raised * smooth(feet[side].height, CLEAR), SPARED * spare(side));
    shifts[side] = shifts[side] + Vec3{drawn[side].x, drawn[side].y, sunk - kick * bears};
  }
  return sunk;
}

Contacts FootLock::clean(FrameHips& hips, FrameTurns& turns, bool steps, bool waits, double shortened,
                         const std::array<double, FRAMES>& upright) {
  if (!state_) state_ = begin(hips[0], turns[0]);
  State& state = *state_;
  const Poses as_made = poses(hips, turns);
  Poses posed = as_made;
  const Drawn drawn = draw_in(posed, state, steps, shortened, true);
  for (std::size_t t = 0; t < FRAMES; ++t)
    for (std::size_t side = 0; side < 2; ++side)
      for (Vec3& sole : posed[t].soles[side]) sole = sole + Vec3{drawn.way[t][side].x, drawn.way[t][side].y, 0};
  const Slides slide = slides(posed, state.soles, steps);
  Contacts contacts{};
  std::array<Feet<Vec3>, FRAMES> shifts;
  std::array<Feet<double>, FRAMES> angles;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const Feet<Slide>& feet = slide[t];
    const Point apart = floor_of(middle(posed[t].soles[1]) - middle(posed[t].soles[0]));
    const double between = length(apart);
    const Point across = (1 / std::max(between, 1e-6)) * apart;
    bool rests = true;
    for (std::size_t side = 0; side < 2; ++side) {
      const Slide& foot = feet[side];
      rests = rests && FPS * length(foot.way) < RESTING[0] && FPS * std::abs(foot.turn) < RESTING[1];
      const bool was = state.contact[side];
      state.contact[side] =
          foot.height < (was ? LIFT_HEIGHT : TOUCH_HEIGHT) && foot.speed < (was ? LIFT_SPEED : TOUCH_SPEED);
      state.hold[side] = bounded(state.hold[side] + (state.contact[side] ? RISE : -RISE), 0, 1);
    }
    set_out(state, steps, rests ? TIDY : waits ? PATIENT : 1, across);
    Feet<Vec3> goals{};
    if (steps) goals = {landing(feet[0].way, feet[0].turn), landing(feet[1].way, feet[1].turn)};
    goals = uncrossed(goals, state.shift, between, across);
    for (std::size_t side = 0; side < 2; ++side) {
      const Slide& foot = feet[side];
      Vec3& shift = state.shift[side];
      const std::optional<double> stays = flight(state.swing[side]);
      const double leashed = (1 - smooth(foot.speed, SLIPPING)) * (1 - smooth(length(floor_of(shift)), LEASH));
      const double grip = stays ? 0 : state.hold[side] * (steps ? 1 : leashed);
      const double kept = stays ? *stays : 1 - (1 - grip) * FADE, ahead = stays ? 1 - kept : 0;
      state.swing[side] = std::max(state.swing[side] - 1, 0);
      const double settling = -foot.height * (1 - local::smooth(foot.height, 0, DROP));
      const double level = shift.z + SETTLE * (state.hold[side] * settling - shift.z);
      state.aim[side] = state.aim[side] + AIM * (goals[side] - state.aim[side]);
      const Vec3& aim = state.aim[side];
      const double turn = kept * state.turn[side] + ahead * aim.z - (steps ? grip * foot.turn : 0);
      const double raised = level + lift(state.swing[side]);
      contacts[t][side] = state.contact[side] && grip >= 0.5 && foot.height + raised <= TOLD_HEIGHT;
      const Point moved = kept * floor_of(shift) + ahead * floor_of(aim) - grip * foot.way;
      shifts[t][side] = {moved.x, moved.y, raised};
      angles[t][side] = state.turn[side] = turn;
      shift = {moved.x, moved.y, level};
    }
  }
  state.soles = posed.back().soles;
  state.shortened = shortened_ = shortened;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const double sunk = sink(posed[t], drawn.way[t], hips[t], slide[t], upright[t], shifts[t]);
    const Point way = sway(as_made[t], drawn.along[t], drawn.stride[t], slide[t]);
    const Vec3 before = hips[t];
    hips[t] = hips[t] + Vec3{way.x, way.y, -sunk};
    for (Vec3& shift : shifts[t]) shift = shift - Vec3{way.x, way.y, 0};
    move_feet(as_made[t], before, shifts[t], angles[t], turns[t], FREE + (STRAIGHTENED - FREE) * upright[t]);
  }
  return contacts;
}

void FootLock::shorten_steps(const FrameHips& hips, FrameTurns& turns, double shortened) {
  restart();
  const double before = shortened_;
  shortened_ = shortened;
  if (before == 0 && shortened == 0) return;
  const Poses posed = poses(hips, turns);
  State state;
  state.shortened = before;
  const Drawn drawn = draw_in(posed, state, true, shortened, false);
  for (std::size_t t = 0; t < FRAMES; ++t) {
    Feet<Vec3> shifts;
    for (std::size_t side = 0; side < 2; ++side) shifts[side] = {drawn.way[t][side].x, drawn.way[t][side].y, 0};
    move_feet(posed[t], hips[t], shifts, {}, turns[t]);
  }
}

// Way by which hips are moved in a frame: aside, to the foot that bears, and along.
Point FootLock::sway(const LegPose& pose, const Feet<double>& along, double stride, const Feet<Slide>& feet) {
  const double phase = bounded((along[0] - along[1]) / std::max(stride, 0.1), -1, 1);
  const double on_left = (feet[1].speed - feet[0].speed) / std::max(feet[0].speed + feet[1].speed, STILL);
  const double strong = on_left * std::min(stride / AMPLE, 1.0) * borne(feet[0].height, feet[1].height);
  const double aside = -SWAY * strong * std::cos(PI / 2 * phase);
  const double ahead = SURGE * strong * (1 - smooth(stride, LONG)) * std::sin(PI * phase);
  return {ahead * pose.facing.x + aside * pose.facing.y, ahead * pose.facing.y - aside * pose.facing.x};
}

}  // namespace wayfarer::local
