// When each person is stepped, and the graph's inputs. Time: frames, 40 per second.

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "person.hpp"

namespace wayfarer {
namespace {

using namespace local;

constexpr double SOON = 1e-3;  // frames: what is due at a moment is due then, however its time was added up

Vec3 flipped(const Vec3& v) { return {-v.x, v.y, v.z}; }
Quat flipped(const Quat& q) { return {q.x, -q.y, -q.z, q.w}; }

// the mirror image in the plane x = 0: of frames of values that change places
template <class T>
std::vector<T> mirrored(const std::vector<T>& values, const std::vector<std::size_t>& other) {
  std::vector<T> result(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::size_t at = k % other.size();
    result[k] = flipped(values[k - at + other[at]]);
  }
  return result;
}

void put(std::vector<float>& to, std::size_t& at, const Vec3& v) {
  for (const double value : {v.x, v.y, v.z}) to[at++] = static_cast<float>(value);
}

void put(std::vector<float>& to, std::size_t& at, const Quat& q) {
  for (const double value : {q.x, q.y, q.z, q.w}) to[at++] = static_cast<float>(value);
}

template <class T>
void put(LocalTensor& tensor, std::size_t row, const std::vector<T>& values) {
  std::size_t at = tensor.values.size() / static_cast<std::size_t>(tensor.shape[0]) * row;
  for (const T& value : values) put(tensor.values, at, value);
}

void put(LocalTensor& tensor, std::size_t row, std::initializer_list<double> values) {
  const std::size_t size = tensor.values.size() / static_cast<std::size_t>(tensor.shape[0]);
  std::transform(values.begin(), values.end(), tensor.values.begin() + static_cast<std::ptrdiff_t>(size * row),
                 [](double value) { return static_cast<float>(value); });
}

std::string_view state_of(Mode mode) {
  static constexpr std::string_view STATES[] = {"standing", "walking", "stopping", "turning", "walking"};
  return STATES[mode];
}

}  // namespace

struct LocalWorld::State {
  LocalModel model;
  LocalRun run;
  Steering steering;
  std::map<int, Person> people;
  int last = 0;

  State(LocalModel given, LocalRun graph)
      : model(std::move(given)), run(std::move(graph)), steering(model.parts().steering) {}

  Person& person(int number) {
    const auto found = people.find(number);
    if (found == people.end()) throw std::invalid_argument("there is no person " + std::to_string(number));
    return found->second;
  }

  double next_event() const {
    double next = std::numeric_limits<double>::infinity();
    for (const auto& [number, person] : people) next = std::min({next, person.plan_frame(), person.send_frame()});
    return next;
  }

  void send(double frame, const Sent& sent) {
    for (auto& [number, person] : people)
      while (person.send_frame() <= frame) sent(shown(number, person, person.send()));
  }

  static LocalChunk shown(int number, const Person& person, const Planned& planned) {
    const Gait& gait = planned.end.gait;
    LocalChunk chunk;
    chunk.person = number;
    chunk.seq = planned.seq;
    chunk.time = person.shown(planned.seq) / FPS;
    chunk.contacts = planned.contacts;
    chunk.state = state_of(gait.mode);
    chunk.flags = planned.flags;
    chunk.waypoint = gait.waypoint;
    chunk.goal_revision = planned.goal_revision;
    const bool passed = planned.through && gait.arrived;
    chunk.done = planned.last && planned.goal_revision > 0 && gait.arrived && (passed || gait.mode == STANDING);
    for (std::size_t t = 0; t < FRAMES; ++t) {
      std::vector<float> frame(91);
      std::size_t at = 0;
      put(frame, at, planned.hips[t]);
      for (const Quat& turn : planned.turns[t]) put(frame, at, turn);
      std::copy(frame.begin(), frame.end(), chunk.frames[t].begin());
    }
    return chunk;
  }

  void tick(double frame, const Sent& sent) {
    send(frame, sent);
    for (;;) {
      std::vector<Person*> due;
      for (auto& [number, person] : people)
        if (person.plan_frame() <= frame) due.push_back(&person);
      if (due.empty()) return;
      // the most urgent first; equally urgent ones keep their order
      std::stable_sort(due.begin(), due.end(), [](auto* a, auto* b) { return a->plan_frame() < b->plan_frame(); });
      const std::string gender = due.front()->spec.gender;
      due.erase(std::remove_if(due.begin(), due.end(), [&](auto* one) { return one->spec.gender != gender; }),
                due.end());
      step(due);
      send(frame, sent);
    }
  }

  void step(const std::vector<Person*>& due) {
    std::vector<Asked> asked;
    for (const Person* person : due) asked.push_back(person->next());
    const LocalTensors made = run(due.front()->spec.gender, feeds(due, asked));
    for (std::size_t row = 0; row < due.size(); ++row) due[row]->take(asked[row], step_of(made, row, *due[row]));
  }

  LocalTensors feeds(const std::vector<Person*>& due, const std::vector<Asked>& asked) const {
    const LocalModel::Parts& parts = model.parts();
    LocalTensors feeds;
    for (std::size_t k = 0; k < parts.inputs.size(); ++k) {
      LocalTensor& tensor = feeds[parts.inputs[k]];
      tensor.shape = parts.shapes[k];
      std::size_t count = 1;
      for (std::int64_t& size : tensor.shape) {
        if (size == 0) size = static_cast<std::int64_t>(due.size());
        count *= static_cast<std::size_t>(size);
      }
      tensor.values.resize(count);
    }
    for (std::size_t row = 0; row < due.size(); ++row) {
      const Person& person = *due[row];
      const Seed& seed = person.seed();
      const auto& [start, gait, goal, targets, noise] = asked[row];
      const ModeInputs& mode = parts.modes[gait.mode];
      const double side = person.mirrored ? -1 : 1;
      std::vector<Vec3> hips(seed.hips.begin(), seed.hips.end()), markers = seed.markers;
      std::vector<Quat> turns;
      for (const Turns& frame : seed.turns) turns.insert(turns.end(), frame.begin(), frame.end());
      if (person.mirrored) {
        for (Vec3& place : hips) place = flipped(place);
        markers = mirrored(markers, parts.mirrored_markers);
        turns = mirrored(turns, parts.mirrored_joints);
      }
      put(feeds.at("seed_markers"), row, markers);
      put(feeds.at("seed_translation"), row, hips);
      put(feeds.at("seed_rotations"), row, turns);
      put(feeds.at("goal"), row, {side * targets.place.x, targets.place.y, 0});
      put(feeds.at("target_speed"), row, {targets.speed});
      put(feeds.at("facing"), row, {side * targets.facing.x, targets.facing.y});
      if (feeds.count("policy")) put(feeds.at("policy"), row, {mode.policy});
      const auto copy = [&](const char* name, const auto& values, auto change) {
        std::transform(values.begin(), values.end(),
                       feeds.at(name).values.begin() + static_cast<std::ptrdiff_t>(values.size() * row), change);
      };
      copy("betas", person.spec.betas, [](double value) { return static_cast<float>(value); });
      if (feeds.count("term_weights"))  // a policy may have no use for one
        copy("term_weights", mode.term_weights, [](float value) { return value; });
      std::array<float, LATENT> drawn = noise;
      const double own = std::sqrt(mode.own), new_ = std::sqrt(1 - mode.own);
      for (std::size_t k = 0; k < LATENT; ++k)
        drawn[k] = static_cast<float>(mode.temperature * (new_ * drawn[k] + own * person.own_noise[k]));
      copy("noise", drawn, [](float value) { return value; });
      if (feeds.count("manner")) copy("manner", person.manner, [](float value) { return value; });
    }
    return feeds;
  }

  Step step_of(const LocalTensors& made, std::size_t row, const Person& person) const {
    const LocalModel::Parts& parts = model.parts();
    const auto pick = [&](const char* name, std::size_t size) {
      const std::vector<float>& values = made.at(name).values;
      if (values.size() < size * (row + 1)) throw std::runtime_error(std::string("the graph made too little ") + name);
      return &values[size * row];
    };
    const std::size_t count = parts.mirrored_markers.size() * SEED;
    const float *hips = pick("translation", 3 * FRAMES), *turns = pick("rotations", 4 * JOINTS * FRAMES);
    const float *markers = pick("next_seed_markers", 3 * count), *contacts = pick("contacts", 2 * FRAMES);
    Step step;
    for (std::size_t t = 0; t < FRAMES; ++t) {
      const float* place = hips + 3 * t;
      step.hips[t] = {place[0], place[1], place[2]};
      for (std::size_t j = 0; j < JOINTS; ++j) {
        const float* q = turns + 4 * (JOINTS * t + (person.mirrored ? parts.mirrored_joints[j] : j));
        step.turns[t][j] = {q[0], q[1], q[2], q[3]};
      }
      for (std::size_t side = 0; side < 2; ++side)
        step.contacts[t][side] = contacts[2 * t + (person.mirrored ? 1 - side : side)] > 0.5F;
    }
    for (std::size_t m = 0; m < count; ++m) step.markers.push_back({markers[3 * m], markers[3 * m + 1], markers[3 * m + 2]});
    if (person.mirrored) {
      step.markers = mirrored(step.markers, parts.mirrored_markers);
      for (Vec3& place : step.hips) place = flipped(place);
      for (Turns& frame : step.turns)
        for (Quat& turn : frame) turn = flipped(turn);
    }
    return step;
  }
};

LocalWorld::LocalWorld(LocalModel model, LocalRun run)
    : state_(std::make_unique<State>(std::move(model), std::move(run))) {}
LocalWorld::LocalWorld(LocalWorld&&) noexcept = default;
LocalWorld::~LocalWorld() = default;

int LocalWorld::add(const LocalSpec& spec, double now) {
  const LocalModel::Parts& parts = state_->model.parts();
  if (!parts.bodies.count(spec.gender)) throw std::invalid_argument(spec.gender + ": the model has no such body");
  const double earliest = std::floor(FPS * now + SOON) + 1 + FRAMES;  // one chunk is planned ahead
  const double start = FRAMES * std::ceil(earliest / FRAMES);         // all are stepped at the same moments
  const int number = ++state_->last;
  state_->people.try_emplace(number, spec, parts, state_->steering, start);
  return number;
}

void LocalWorld::remove(int person) {
  state_->person(person);
  state_->people.erase(person);
}

void LocalWorld::give(int person, const std::vector<LocalGoal>& goals, double now) {
  state_->person(person).give(goals, FPS * now);
}

void LocalWorld::append(int person, const std::vector<LocalGoal>& goals, double now) {
  state_->person(person).append(goals, FPS * now);
}

std::vector<float> LocalWorld::bones(int person) const {
  std::vector<float> offsets;
  for (const Vec3& bone : state_->person(person).bones())
    for (const double value : {bone.x, bone.y, bone.z}) offsets.push_back(static_cast<float>(value));
  return offsets;
}

void LocalWorld::advance(double until, const Sent& sent) {
  const double frame = FPS * until + SOON;
  for (double next = state_->next_event(); next <= frame; next = state_->next_event()) state_->tick(next, sent);
}

}  // namespace wayfarer
