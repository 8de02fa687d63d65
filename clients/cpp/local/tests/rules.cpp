// Rules of wayfarer::local on the rows in a file, as JSON: the tests of clients/web/test/local_*.js.
// rules random|guards|righting|rules FILE

#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "guards.hpp"
#include "random.hpp"
#include "righting.hpp"
#include "steering.hpp"

namespace {

using namespace wayfarer::local;
using wayfarer::Quat;
using wayfarer::Vec3;
using Json = nlohmann::json;

double number(const Json& values, std::size_t at) { return values.at(at).get<double>(); }
Vec3 vector(const Json& values, std::size_t k) {
  return {number(values, 3 * k), number(values, 3 * k + 1), number(values, 3 * k + 2)};
}
Quat turn(const Json& values, std::size_t k) {
  return {number(values, 4 * k), number(values, 4 * k + 1), number(values, 4 * k + 2), number(values, 4 * k + 3)};
}
Point point(const Json& values) { return {number(values, 0), number(values, 1)}; }

template <class Frames>
Frames vectors(const Json& values) {
  Frames frames;
  for (std::size_t k = 0; k < frames.size(); ++k) frames[k] = vector(values, k);
  return frames;
}
template <class Frames>
Frames turns(const Json& values) {
  Frames frames;
  for (std::size_t t = 0; t < frames.size(); ++t)
    for (std::size_t j = 0; j < JOINTS; ++j) frames[t][j] = turn(values, JOINTS * t + j);
  return frames;
}

Json flat(const Vec3& v) { return {v.x, v.y, v.z}; }
Json flat(const Quat& q) { return {q.x, q.y, q.z, q.w}; }
template <class Values>
Json flat(const Values& values) {
  Json all = Json::array();
  for (const auto& value : values)
    for (const Json& each : flat(value)) all.push_back(each);
  return all;
}

Legs legs_of(const Json& given) {
  Legs legs;
  for (std::size_t side = 0; side < 2; ++side) {
    legs.hip[side] = vector(given.at("hip"), side);
    legs.knee[side] = vector(given.at("knee"), side);
    legs.ankle[side] = vector(given.at("ankle"), side);
    legs.ball[side] = vector(given.at("ball"), side);
    for (std::size_t p = 0; p < SOLES; ++p) {
      legs.sole_of_ankle[side][p] = vector(given.at("soleOfAnkle"), SOLES * side + p);
      legs.sole_of_ball[side][p] = vector(given.at("soleOfBall"), SOLES * side + p);
      legs.ball_share[side][p] = number(given.at("ballShare"), SOLES * side + p);
    }
  }
  legs.measure();
  return legs;
}

Json drawn(const Json& seeds) {
  Json found = Json::array();
  for (const Json& given : seeds) {
    const std::uint64_t seed = std::stoull(given.get<std::string>());
    found.push_back({{"own", own_noise_of(seed)},
                     {"manner", manner_of(seed)},
                     {"noise", noise_of(seed, 7)},
                     {"mirrored", is_mirrored(seed)},
                     {"reaction", reaction_of(seed, 3)}});
  }
  return found;
}

Json guarded(const Json& given) {
  const Legs legs = legs_of(given.at("legs"));
  const auto seed_of = [](const Json& one) {
    return Seed{vectors<std::array<Vec3, SEED>>(one.at("translation")),
                turns<std::array<Turns, SEED>>(one.at("rotations")), {}};
  };
  Json found = Json::array();
  for (const Json& step : given.at("steps")) {
    const Seed seed = seed_of(step.at("seed"));
    Seed stand = seed_of(step.at("stand"));
    const auto hips = vectors<FrameHips>(step.at("translation"));
    const auto rotations = turns<FrameTurns>(step.at("rotations"));
    FrameTurns bent = rotations;
    make_bendable(bent, legs);
    FrameHips up_hips;
    FrameTurns up_turns;
    get_up(seed, stand, up_hips, up_turns);
    found.push_back({{"bendable", flat(bent)},
                     {"fallen", fallen(hips, rotations, legs)},
                     {"upTranslation", flat(up_hips)},
                     {"upRotations", flat(up_turns)},
                     {"stand", flat(stand.turns)}});
  }
  return found;
}

Json righted(const Json& given) {
  const std::vector<double> shares = shares_of(given.at("names").get<std::vector<std::string>>());
  Json found = Json::array();
  for (const Json& row : given.at("steps")) {
    Step step{vectors<FrameHips>(row.at("translation")), turns<FrameTurns>(row.at("rotations")), {}, {}};
    for (std::size_t k = 0; k < SEED * shares.size(); ++k) step.markers.push_back(vector(row.at("markers"), k));
    const auto before = step.turns.back()[3];
    right(static_cast<Mode>(row.at("mode").get<int>()), shares, step);
    const auto& after = step.turns.back()[3];
    found.push_back({{"same", before.x == after.x && before.y == after.y && before.z == after.z},
                     {"rotations", flat(step.turns)},
                     {"markers", flat(step.markers)}});
  }
  return found;
}

Json decided(const Json& row, const Steering& steering) {
  const Json &gait = row.at("gait"), &start = row.at("start"), &goal = row.at("goal");
  Gait before;
  before.mode = static_cast<Mode>(gait.at("mode").get<int>());
  before.speed = gait.at("speed");
  before.slow_seconds = gait.at("slowSeconds");
  before.arrived = gait.at("arrived");
  before.rested = gait.at("rested");
  before.trim = gait.at("trim");
  before.stop_place = point(gait.at("stopPlace"));
  before.stop_facing = point(gait.at("stopFacing"));
  GoalRow ahead;
  ahead.given = goal.at("given");
  ahead.place = point(goal.at("place"));
  ahead.radius = goal.at("radius");
  ahead.speed = goal.at("speed");
  ahead.has_heading = !goal.at("heading").is_null();
  if (ahead.has_heading) ahead.heading = point(goal.at("heading"));
  ahead.strafe = goal.at("strafe");
  ahead.through = goal.at("through");
  ahead.bend = goal.at("bend");
  ahead.onward = point(goal.at("onward"));
  const Start from{point(start.at("hips")), point(start.at("first")), point(start.at("facing"))};
  const Gait after = steering.decide(before, from, ahead, row.at("ready"));
  const Targets next = steering.targets(after, from, ahead);
  return {{"mode", int(after.mode)},
          {"rested", after.rested},
          {"numbers",
           {after.slow_seconds, after.stop_place.x, after.stop_place.y, after.stop_facing.x, after.stop_facing.y,
            next.place.x, next.place.y, next.speed, next.facing.x, next.facing.y}}};
}

Json moved(const Json& one, const Legs& legs) {
  const auto hips = vectors<FrameHips>(one.at("translation"));
  const auto shifts = vectors<std::array<Vec3, 2 * FRAMES>>(one.at("shift"));
  auto rotations = turns<FrameTurns>(one.at("rotations"));
  for (std::size_t t = 0; t < FRAMES; ++t)
    move_ankles(LegPose(legs, hips[t], rotations[t]), {shifts[2 * t], shifts[2 * t + 1]}, rotations[t]);
  return flat(rotations);
}

Json ruled(const Json& given) {
  std::map<std::string, double> constants;
  for (const auto& [name, constant] : given.at("constants").items()) constants[name] = constant.at("value");
  const Steering steering(constants);
  const Legs legs = legs_of(given.at("legs"));
  Json gaits = Json::array(), poses = Json::array();
  for (const Json& row : given.at("gaits")) gaits.push_back(decided(row, steering));
  for (const Json& one : given.at("poses")) poses.push_back(moved(one, legs));
  return {{"gaits", gaits}, {"poses", poses}};
}

}  // namespace

int main(int, char** words) {
  std::ifstream file(words[2]);
  const Json given = Json::parse(file);
  const std::string rule = words[1];
  std::cout << (rule == "random" ? drawn(given) : rule == "guards" ? guarded(given) : rule == "righting" ? righted(given) : ruled(given));
  return 0;
}
