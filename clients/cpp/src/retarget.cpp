#include "wayfarer/retarget.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "alignment.hpp"

namespace wayfarer {
namespace {

const double SNAP = std::cos(25 * 3.141592653589793 / 180);  // an up or left so near to an axis is meant to be it
constexpr double REACH = 0.999;  // of a leg's length: how far it is stretched at most
constexpr double SINKS = 0.018;  // of a leg's length: how far hips sink at most for a standing foot to reach its print
// heights of a sole over the ground by the leg's length: hips sink and a heel rises by all that a foot lacks while it is
// below the first, by nothing when it is above the second
constexpr double STANDS = 0.02, LEAVES = 0.06;
constexpr double TIPTOE = 0.25;   // radians: how far a heel rises at most for a foot to reach its print
constexpr double FLEX = 0.5;     // radians: how far toes turn up at most where a shoe is longer than the agent's foot
constexpr double BEND = 0.1;     // of the thigh's length: a knee that bends less than this bends forwards
constexpr double HEEL = 0.34;    // of the way from ankle to ball: how far the heel is behind the ankle
constexpr double TIP = 0.38;     // of the way from ankle to ball: how far the tip of the toes is before the ball

struct ArmBones {
  int shoulder, elbow, wrist;
};
constexpr ArmBones ARMS[2]{
    {bone_number("left_shoulder"), bone_number("left_elbow"), bone_number("left_wrist")},
    {bone_number("right_shoulder"), bone_number("right_elbow"), bone_number("right_wrist")}};

Vec3 snapped(const Vec3& direction) {
  const Vec3 v = (1 / length(direction)) * direction;
  const double x = std::abs(v.x), y = std::abs(v.y), z = std::abs(v.z);
  if (std::max({x, y, z}) < SNAP) return v;
  if (x >= y && x >= z) return {std::copysign(1, v.x), 0, 0};
  if (y >= z) return {0, std::copysign(1, v.y), 0};
  return {0, 0, std::copysign(1, v.z)};
}

/// The middle of the thigh joints: where the pelvis is. A rig's hips joint lies anywhere around it.
template <class Places>
Vec3 middle(const Places& place) {
  return 0.5 * (place[static_cast<std::size_t>(LEGS[0].hip)] + place[static_cast<std::size_t>(LEGS[1].hip)]);
}

/// Whether its feet are so close above the origin's level that this is its floor.
bool stands(double lowest, double hips) { return lowest >= 0 && lowest <= 0.25 * (hips - lowest); }

}  // namespace

Quat alignment(const BoneMap& map, const Basis& basis) {
  const auto joint = [&](int b) { return map.rig().place(map.nodes()[static_cast<std::size_t>(b)]); };
  const Vec3 feet = 0.5 * (joint(LEGS[0].ankle) + joint(LEGS[1].ankle));
  const Vec3 up = snapped(0.5 * (joint(LEGS[0].hip) + joint(LEGS[1].hip)) - feet);
  Vec3 left = snapped(without(joint(LEGS[0].hip) - joint(LEGS[1].hip), up));
  left = without(left, up);
  left = (1 / length(left)) * left;
  const Vec3 forward = basis.handed * cross(left, up);
  return between({left, up, forward}, {basis.left, basis.up, basis.forward});
}

CharacterJoints character_joints(const BoneMap& map, const Basis& basis, const Soles* soles) {
  const Quat turn = alignment(map, basis);
  const auto has = [&](int b) { return map.nodes()[static_cast<std::size_t>(b)] >= 0; };
  CharacterJoints found;
  for (int b = 0; b < BONE_COUNT; ++b)
    if (has(b))
      found.places[static_cast<std::size_t>(b)] =
          rotate(turn, map.rig().place(map.nodes()[static_cast<std::size_t>(b)]));
  double lowest = std::numeric_limits<double>::infinity();
  for (const auto& [hip, knee, ankle, toe] : LEGS)
    for (const int b : {ankle, toe})
      if (has(b)) lowest = std::min(lowest, dot(found.places[static_cast<std::size_t>(b)], basis.up));
  if (soles) found.floor = soles->floor;
  else if (stands(lowest, dot(middle(found.places), basis.up))) found.floor = 0;
  return found;
}

Retarget::Retarget(const BoneMap& map, const std::vector<float>& rest_offsets, const Basis& basis, double floor,
                   const Soles* soles)
    : basis_(basis), nodes_(map.nodes()) {
  const Rig& rig = map.rig();
  if (rest_offsets.size() < 3 * BONE_COUNT)
    throw std::invalid_argument("rest offsets of " + std::to_string(BONE_COUNT) + " bones are needed");
  for (int b = 0; b < BONE_COUNT; ++b) {
    const float* offset = &rest_offsets[3 * at(b)];
    offsets_[at(b)] = {offset[0], offset[1], offset[2]};
    const int parent = PARENTS[at(b)];
    source_rest_[at(b)] = parent < 0 ? offsets_[at(b)] : source_rest_[at(parent)] + offsets_[at(b)];
    above_[at(b)] = hangs_[at(b)] = -1;
    if (!has(b)) continue;
    int above = PARENTS[at(b)];
    while (above >= 0 && !has(above)) above = PARENTS[at(above)];
    above_[at(b)] = above;
    mapped_.push_back(b);
    for (const int node : rig.ancestors(nodes_[at(b)])) {
      const auto found = std::find(nodes_.begin(), nodes_.end(), node);
      if (found == nodes_.end()) continue;
      hangs_[at(b)] = static_cast<int>(found - nodes_.begin());
      break;
    }
    if (b == 0 || hangs_[at(b)] != above_[at(b)]) loose_.push_back(b);
  }
  const Quat turn = alignment(map, basis);
  PerBone<Quat> rest{};
  PerBone<Vec3> place{};
  for (const int b : mapped_) {
    rest[at(b)] = multiply(turn, rig.rotation(node(b)));
    place[at(b)] = rotate(turn, rig.place(node(b)));
  }
  const PerBone<Quat> correct = corrections(place);
  for (const int b : mapped_) {
    rest_[at(b)] = multiply(correct[at(b)], rest[at(b)]);
    const int a = above_[at(b)], hangs = hangs_[at(b)], parent = rig.node(node(b)).parent;
    if (a >= 0) offset_[at(b)] = rotate(inverse(rest[at(a)]), place[at(b)] - place[at(a)]);
    if (parent < 0) continue;
    Parent& own = parents_[at(b)];
    own = {rig.rotation(parent), rig.place(parent), rig.scale(parent)};
    if (hangs < 0) continue;
    const Quat back = inverse(rig.rotation(node(hangs)));
    own.turn = multiply(back, own.turn);
    own.place = rotate(back, own.place - rig.place(node(hangs)));
  }
  thighs_ = rotate(inverse(rest[0]), middle(place) - place[0]);
  measure_legs(place, correct, floor, soles);
}

/// What turns each bone from the character's rest pose into a T-pose.
Retarget::PerBone<Quat> Retarget::corrections(const PerBone<Vec3>& place) const {
  struct Aim {
    int end = -1;
    Vec3 direction{};
  };
  PerBone<Aim> aims{};
  for (int side = 0; side < 2; ++side) {
    const Vec3 out = side ? -basis_.left : basis_.left;
    const auto& [hip, knee, ankle, toe] = LEGS[side];
    const auto& [shoulder, elbow, wrist] = ARMS[side];
    aims[at(hip)] = {knee, -basis_.up};
    aims[at(knee)] = {ankle, -basis_.up};
    aims[at(shoulder)] = {elbow, out};
    aims[at(elbow)] = {wrist, out};
  }
  PerBone<Quat> correct{};
  for (const int b : mapped_) {
    Quat turn = above_[at(b)] < 0 ? Quat{} : correct[at(above_[at(b)])];
    const auto& [end, aim] = aims[at(b)];
    if (end >= 0 && has(end)) turn = multiply(arc(rotate(turn, place[at(end)] - place[at(b)]), aim), turn);
    correct[at(b)] = turn;
  }
  for (const auto& [hip, knee, ankle, toe] : LEGS) {  // soles stay level: feet only turn to the front
    const Vec3 ahead = has(toe) ? basis_.level(place[at(toe)] - place[at(ankle)]) : basis_.forward;
    correct[at(ankle)] = arc(ahead, basis_.forward);
    if (has(toe)) correct[at(toe)] = correct[at(ankle)];
  }
  return correct;
}

void Retarget::measure_legs(const PerBone<Vec3>& place, const PerBone<Quat>& correct, double floor,
                            const Soles* soles) {
  const Vec3& up = basis_.up;
  const PerBone<Vec3>& source = source_rest_;
  PerBone<Vec3> stand{};  // joint places in the T-pose
  stand[0] = place[0];
  for (const int b : mapped_) {
    const int a = above_[at(b)];
    if (a >= 0) stand[at(b)] = stand[at(a)] + rotate(correct[at(a)], place[at(b)] - place[at(a)]);
  }
  double legs = 0, source_legs = 0;
  double lowest = std::numeric_limits<double>::infinity(), source_lowest = lowest;
  for (const auto& [hip, knee, ankle, toe] : LEGS) {
    legs += dot(stand[at(hip)] - stand[at(ankle)], up);
    source_legs += dot(source[at(hip)] - source[at(ankle)], up);
    for (const int b : {ankle, toe}) {
      source_lowest = std::min(source_lowest, dot(source[at(b)], up));
      if (has(b)) lowest = std::min(lowest, dot(place[at(b)], up));
    }
  }
  const double scale = legs / source_legs;
  if (floor != floor && soles) floor = soles->floor;
  if (floor != floor) {
    floor = stands(lowest, dot(middle(place), up)) ? 0 : lowest - scale * source_lowest;
  }
  const Vec3 thighs = middle(stand), source_thighs = middle(source);
  double high = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const auto& [hip, knee, ankle, toe] = LEGS[k];
    const Vec3 ball = source[at(toe)] - source[at(ankle)];
    legs_[k].source_sole = sole_of(ball, dot(source[at(ankle)], up));
    // without toes, where a foot of this size would have them
    const Vec3 own =
        has(toe) ? rotate(correct[at(ankle)], place[at(toe)] - place[at(ankle)]) : scale * ball;
    const double height = dot(place[at(ankle)], up) - floor;
    high += height / 2;
    legs_[k].sole = sole_of(own, height);
    if (soles) {
      Sole& sole = legs_[k].sole;
      sole.joint = own;
      sole.fixed = soles->feet[k].fixed;
      sole.toes = has(toe) ? soles->feet[k].toes : std::vector<Vec3>();
      for (Vec3& point : sole.fixed) point = rotate(correct[at(ankle)], point);
      for (Vec3& point : sole.toes) point = rotate(correct[at(ankle)], point);
    }
    const Sole& sole = legs_[k].sole;
    double before = -std::numeric_limits<double>::infinity(), low = -before;
    for (const Vec3& point : sole.toes) {
      before = std::max(before, dot(point, basis_.forward));
      low = std::min(low, dot(point, up));
    }
    if (!sole.toes.empty()) legs_[k].tip = before * basis_.forward + low * up;
    legs_[k].length = length(offset_[at(knee)]) + length(offset_[at(ankle)]);
    const Vec3 beside = stand[at(ankle)] + own - thighs - (source[at(toe)] - source_thighs);
    legs_[k].stance = dot(beside, basis_.left) * basis_.left;
  }
  ratio_ = (legs / 2 + high) / dot(source_thighs, up);
}

/// A foot of which only the joints are known: the toes' from the ankle, which is at this height.
Retarget::Sole Retarget::sole_of(const Vec3& toe, double height) const {
  const Vec3 ahead = basis_.level(toe), down = -height * basis_.up;
  const Vec3 ball = down + ahead, heel = down - HEEL * ahead, under = ball - toe;
  return {heel, ball, toe, {heel, ball}, {under, under + TIP * ahead}};
}

void Retarget::pose(const float* frame, double ground) {
  const Vec3& up = basis_.up;
  pose_source(frame);
  for (int leg = 0; leg < 2; ++leg) {
    double low;
    lowest(legs_[at(leg)].source_sole, leg, low);
    legs_[at(leg)].clear = dot(source_[at(LEGS[leg].ankle)], up) + low;
    flex(leg, low);
  }
  if (ground != ground) ground = std::min(legs_[0].clear, legs_[1].clear);
  ground_ = ground;
  for (const int b : mapped_) world_[at(b)] = multiply(turns_[at(b)], rest_[at(b)]);
  const Vec3 thighs = middle(source_);
  const double lifted = ground + (dot(thighs, up) - ground) * ratio_;
  places_[0] = basis_.level(thighs) + lifted * up - rotate(world_[0], thighs_);
  put();
  double sunk = 0;
  for (int leg = 0; leg < 2; ++leg) {
    const double high = std::max(0.0, legs_[at(leg)].clear - ground) * ratio_;
    Leg& own = legs_[at(leg)];
    own.goal = goal_of(leg, ground + high);
    own.most = reach(leg);
    own.stays = std::clamp((LEAVES - high / own.length) / (LEAVES - STANDS), 0.0, 1.0);
    sunk = std::max(sunk, lacks(leg));
  }
  for (const int b : mapped_) places_[at(b)] = places_[at(b)] - sunk * up;
  for (int leg = 0; leg < 2; ++leg) {
    raise(leg);
    bend(leg);
  }
  put();
  relate();
}

/// Rotations and places of the agent's bones in the world.
void Retarget::pose_source(const float* frame) {
  for (int b = 0; b < BONE_COUNT; ++b) {
    const float* q = frame + 3 + 4 * b;
    const Quat own = normalized({q[0], q[1], q[2], q[3]});
    const int parent = PARENTS[at(b)];
    if (parent < 0) {
      turns_[at(b)] = own;
      source_[at(b)] = {frame[0], frame[1], frame[2]};
    } else {
      turns_[at(b)] = multiply(turns_[at(parent)], own);
      source_[at(b)] = source_[at(parent)] + rotate(turns_[at(parent)], offsets_[at(b)]);
    }
  }
}

/// The ball relative to the ankle, and the `height` of the foot's lowest point over its ankle.
Vec3 Retarget::lowest(const Sole& sole, int leg, double& height) const {
  const Quat &ankle = turns_[at(LEGS[leg].ankle)], &toe = turns_[at(LEGS[leg].toe)];
  const Vec3 up = rotate(inverse(ankle), basis_.up), up_of_toes = rotate(inverse(toe), basis_.up);
  height = std::numeric_limits<double>::infinity();
  for (const Vec3& point : sole.fixed) height = std::min(height, dot(point, up));
  for (const Vec3& point : sole.toes) height = std::min(height, dot(sole.joint, up) + dot(point, up_of_toes));
  return rotate(ankle, sole.ball);
}

/// Places of the bones below the hips.
void Retarget::put() {
  for (const int b : mapped_) {
    const int a = above_[at(b)];
    if (a >= 0) places_[at(b)] = places_[at(a)] + rotate(world_[at(a)], offset_[at(b)]);
  }
}

/// Where the ankle goes: the ball over the same point as the agent's, the lowest of the foot at the height `sole`.
Vec3 Retarget::goal_of(int leg, double sole) const {
  const Vec3& up = basis_.up;
  const int ankle = LEGS[leg].ankle;
  const Leg& own = legs_[at(leg)];
  const Quat& foot = turns_[at(ankle)];
  Vec3 ahead = basis_.level(rotate(foot, basis_.forward));
  if (length(ahead) < 0.1) ahead = basis_.level(rotate(turns_[0], basis_.forward));  // it points straight down
  double low;
  const Vec3 ball = lowest(own.sole, leg, low);
  const Vec3 print = source_[at(ankle)] + rotate(foot, own.source_sole.ball);
  const Vec3 beside = rotate(arc(basis_.forward, ahead), own.stance);
  return basis_.level(print + beside - ball) + (sole - low) * up;
}

/// Turn up the toes of a long shoe, so that the ankle is as high over where it stands as the agent's, scaled; `low`: the
/// agent's lowest point from its ankle.
void Retarget::flex(int leg, double low) {
  const Leg& own = legs_[at(leg)];
  const Quat& foot = turns_[at(LEGS[leg].ankle)];
  Quat& toe = turns_[at(LEGS[leg].toe)];
  Vec3 axis = -basis_.handed * basis_.level(rotate(foot, basis_.left));
  const double wide = length(axis);
  if (!has(LEGS[leg].toe) || own.sole.toes.empty() || wide < 0.1) return;
  axis = 1 / wide * axis;
  const double stands = dot(ratio_ * own.source_sole.ball - own.sole.ball, basis_.up);
  const double deep = std::min(0.0, ratio_ * low - stands - dot(rotate(foot, own.sole.joint), basis_.up));
  const Vec3 tip = rotate(toe, own.tip);
  const double high = dot(tip, basis_.up), rises = dot(cross(axis, tip), basis_.up);
  const double share = deep / std::max(std::hypot(high, rises), 1e-9);
  const double angle = std::asin(std::max(-1.0, share)) - std::atan2(high, rises);
  const double half = std::clamp(angle, 0.0, FLEX) / 2, sine = std::sin(half);
  toe = multiply({sine * axis.x, sine * axis.y, sine * axis.z, std::cos(half)}, toe);
}

/// How far an ankle may be from its thigh joint: as straight as the agent's leg is, and from there smoothly less of what
/// the goal asks for.
double Retarget::reach(int leg) const {
  const auto& [hip, knee, ankle, toe] = LEGS[leg];
  const Leg& own = legs_[at(leg)];
  const double bones = length(offsets_[at(knee)]) + length(offsets_[at(ankle)]);
  const double agents = length(source_[at(ankle)] - source_[at(hip)]) / bones;
  const double over = length(own.goal - places_[at(hip)]) / own.length - agents;
  const double room = std::max(REACH - agents, 1e-6);
  return std::min(REACH, agents + room * (1 - std::exp(-std::max(0.0, over) / room))) * own.length;
}

/// How far the hips must sink for a foot to reach its print.
double Retarget::lacks(int leg) const {
  const Leg& own = legs_[at(leg)];
  const Vec3 way = places_[at(LEGS[leg].hip)] - own.goal;
  const double away = length(basis_.level(way));
  const double lacking = dot(way, basis_.up) - std::sqrt(std::max(0.0, own.most * own.most - away * away));
  return std::min(SINKS * own.length, std::max(0.0, lacking) * own.stays);
}

/// Lift the heel so far that the leg reaches its goal: the foot turns about its ball, as far as the ball bears it.
void Retarget::raise(int leg) {
  const int ankle = LEGS[leg].ankle;
  Leg& own = legs_[at(leg)];
  const Quat& foot = turns_[at(ankle)];
  const Vec3 heel = rotate(foot, own.sole.heel), ball = rotate(foot, own.sole.ball);
  Vec3 axis = basis_.level(rotate(foot, basis_.left));
  axis = 1 / length(axis) * axis;
  Vec3 raises = cross(ball, axis);  // which way the ankle goes
  if (dot(raises, basis_.up) < 0) {
    axis = -axis;
    raises = -raises;
  }
  const Vec3 thigh = places_[at(LEGS[leg].hip)] - own.goal - ball, aside = dot(axis, ball) * axis;  // from the ball
  const double near = dot(thigh, aside - ball), ahead = dot(thigh, raises);
  const double wanted = (dot(thigh, thigh) + dot(ball, ball) - own.most * own.most) / 2 + dot(thigh, aside);
  const double share = wanted / std::max(std::hypot(near, ahead), 1e-9);
  const double lacking = std::atan2(ahead, near) - std::acos(std::clamp(share, -1.0, 1.0));
  const double bears = std::clamp(1 - dot(ball - heel, basis_.up) / (STANDS * own.length), 0.0, 1.0);
  const double half = own.stays * bears * std::clamp(lacking, 0.0, TIPTOE) / 2, sine = std::sin(half);
  const Quat turn{sine * axis.x, sine * axis.y, sine * axis.z, std::cos(half)};
  world_[at(ankle)] = multiply(turn, world_[at(ankle)]);
  own.goal = own.goal + ball - rotate(turn, ball);
}

/// Turn thigh and shin so that the ankle is at its goal, or as near as the leg reaches.
void Retarget::bend(int leg) {
  const auto& [hip, knee, ankle, toe] = LEGS[leg];
  const Vec3 &start = places_[at(hip)], &bend = places_[at(knee)], &end = places_[at(ankle)];
  const double thigh = length(bend - start), shin = length(end - bend);
  const Vec3 goal = within(start, legs_[at(leg)].goal, legs_[at(leg)].most, 1.001 * std::abs(thigh - shin));
  const double far = length(goal - start);
  const Vec3 along = (1 / far) * (goal - start);
  Vec3 side = without(bend - start, along);
  Vec3 front = without(rotate(turns_[at(hip)], basis_.forward), along);
  front = 1 / std::max(length(front), 1e-6) * front;
  side = side + std::max(0.0, BEND * thigh - dot(side, front)) * front;
  side = 1 / std::max(length(side), 1e-9) * side;
  const double reach = (thigh * thigh + far * far - shin * shin) / (2 * far);
  const Vec3 knee_at = start + reach * along + std::sqrt(std::max(0.0, thigh * thigh - reach * reach)) * side;
  world_[at(hip)] = multiply(arc(bend - start, knee_at - start), world_[at(hip)]);
  world_[at(knee)] = multiply(arc(end - bend, goal - knee_at), world_[at(knee)]);
}

/// A place that the leg reaches: at the goal's height, if it can, nearer to the hip.
Vec3 Retarget::within(const Vec3& start, const Vec3& goal, double most, double least) const {
  double down = dot(goal - start, basis_.up);
  Vec3 away = basis_.level(goal - start);
  const double wide = length(away), far = std::sqrt(down * down + wide * wide);
  if (far > most) {
    down = std::max(-most, std::min(most, down));
    away = std::sqrt(most * most - down * down) / std::max(wide, 1e-9) * away;
  } else if (far < least) {
    return start - least * basis_.up;
  }
  return start + away + down * basis_.up;
}

/// Rotations relative to the nodes' parents, and places of loose bones.
void Retarget::relate() {
  for (const int b : mapped_) {
    const int a = hangs_[at(b)];
    const Parent& own = parents_[at(b)];
    const Quat turn = a < 0 ? own.turn : multiply(world_[at(a)], own.turn);
    local_[at(b)] = multiply(inverse(turn), world_[at(b)]);
    if (b != 0 && a == above_[at(b)]) continue;
    const Vec3 place = a < 0 ? own.place : places_[at(a)] + rotate(world_[at(a)], own.place);
    const Vec3 way = rotate(inverse(turn), places_[at(b)] - place);
    moved_[at(b)] = {way.x / own.scale.x, way.y / own.scale.y, way.z / own.scale.z};
  }
}

}  // namespace wayfarer
