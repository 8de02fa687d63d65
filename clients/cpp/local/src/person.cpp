#include "person.hpp"

#include <limits>

namespace wayfarer::local {
namespace {

constexpr int LEAD = 1;                              // chunks that are planned ahead of their time
constexpr int REPLAN_FRAMES = 4, REPLAN_MARGIN = 2;  // a chunk that is shown this soon is not planned again
constexpr double NEVER = std::numeric_limits<double>::infinity();

// where the next step starts
Seed end_of(const Step& step) {
  Seed seed;
  seed.markers = step.markers;
  for (std::size_t s = 0; s < SEED; ++s) {
    const std::size_t t = FRAMES - SEED + s;
    seed.hips[s] = rounded(step.hips[t]);
    for (std::size_t j = 0; j < JOINTS; ++j) seed.turns[s][j] = rounded(step.turns[t][j]);
  }
  return seed;
}

}  // namespace

Person::Person(const LocalSpec& given, const LocalModel::Parts& model, const Steering& steering, double start)
    : spec(given),
      mirrored(is_mirrored(given.seed)),
      own_noise(own_noise_of(given.seed)),
      manner(manner_of(given.seed)),
      body_(model.bodies.at(given.gender)),
      soles_(model.soles),
      shares_(model.shares),
      leg_shares_(model.leg_shares),
      steering_(steering),
      legs_(body_.legs(given.betas)),
      reaction_(reaction_of(given.seed, steering.reactions)),
      planned_(stand({given.x, given.y}, given.heading)),
      committed_(planned_),
      start_(start) {}

double Person::plan_frame() const {
  if (planned_chunks_ - sent_chunks_ > LEAD) return NEVER;
  return shown(planned_chunks_) - (replanned_ ? REPLAN_FRAMES : LEAD * FRAMES);
}

double Person::send_frame() const { return queue_.empty() ? NEVER : shown(sent_chunks_); }

double Person::shown(int seq) const { return start_ + FRAMES * seq; }

void Person::give(const std::vector<LocalGoal>& goals, double frame) {
  replan(frame + REPLAN_MARGIN);
  ++revision_;
  from_ = floor_of(planned_.seed.hips.back());
  goals_ = goals;
  path_ = goal_rows(goals_, from_);
  if (!goals.empty()) planned_.gait.mode = WALKING;
  planned_.gait.arrived = false;
  planned_.gait.waypoint = 0;
}

void Person::append(const std::vector<LocalGoal>& goals, double frame) {
  if (goals_.empty()) return give(goals, frame);
  ++revision_;
  goals_.insert(goals_.end(), goals.begin(), goals.end());
  path_ = goal_rows(goals_, from_);
}

Asked Person::next() const {
  const Seed& seed = planned_.seed;
  const Start start{floor_of(seed.hips[1]), floor_of(seed.hips[0]), facing_of(seed.turns[1][0])};
  Gait gait = steering_.advance(planned_.gait, goal_at(path_, planned_.gait.waypoint));
  const GoalRow goal = goal_at(path_, gait.waypoint);
  const bool ready = (planned_chunks_ + reaction_) % steering_.reactions == 0;
  gait = steering_.decide(gait, start, goal, ready);
  return {start, gait, goal, steering_.targets(gait, start, goal), noise_of(spec.seed, planned_chunks_)};
}

void Person::take(const Asked& asked, Step made) {
  const auto& [start, gait, goal, targets, noise] = asked;
  const Seed& seed = planned_.seed;
  const bool is_broken = broken(seed.hips.back(), made);
  if (is_broken) {
    made.hips.fill(seed.hips.back());
    made.turns.fill(seed.turns.back());
  }
  make_bendable(made.turns, legs_);
  right(gait.mode, shares_, made);
  if (spec.foot_lock) lock_feet(legs_, leg_shares_, seed, made);
  const Gait after = observe(gait, start.hips, made.hips, goal);
  int flags = replanned_ ? LocalChunk::REPLANNED : 0;
  if (after.arrived && !gait.arrived) flags |= LocalChunk::ARRIVED;
  Motion end{end_of(made), after};
  if (is_broken || fallen(made.hips, made.turns, legs_)) {
    if (is_broken) flags |= LocalChunk::FIRST;
    end = stand(start.hips, std::atan2(-start.facing.x, start.facing.y));
    end.gait.waypoint = after.waypoint;
    get_up(seed, end.seed, made.hips, made.turns);
    for (auto& both : made.contacts) both = {true, true};
  }
  queue_.push_back(
      {planned_chunks_, flags, revision_, !goal.more, goal.through, made.hips, made.turns, made.contacts, end});
  planned_ = std::move(end);
  ++planned_chunks_;
  replanned_ = false;
}

Planned Person::send() {
  Planned chunk = std::move(queue_.front());
  queue_.pop_front();
  ++sent_chunks_;
  committed_ = chunk.end;
  return chunk;
}

// throw away planned chunks that are shown after a world frame
void Person::replan(double until) {
  const std::size_t before = queue_.size();
  while (!queue_.empty() && shown(queue_.back().seq) > until) queue_.pop_back();
  if (queue_.size() == before) return;
  replanned_ = true;
  planned_chunks_ = sent_chunks_ + static_cast<int>(queue_.size());
  planned_ = queue_.empty() ? committed_ : queue_.back().end;
}

Motion Person::stand(Point place, double heading) const {
  Motion motion;
  motion.seed = body_.stand(spec.seed % body_.poses(), spec.betas, soles_, place, heading);
  motion.gait.stop_place = place;
  motion.gait.stop_facing = {-std::sin(heading), std::cos(heading)};
  return motion;
}

}  // namespace wayfarer::local
