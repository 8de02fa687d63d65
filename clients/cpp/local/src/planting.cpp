#include "planting.hpp"

#include <algorithm>

namespace wayfarer::local {
namespace {

constexpr double MAX_SHIFT = 0.03, MAX_TURN = 2 * DEGREE;    // of a step
constexpr double AWRY = 1.5 * DEGREE, BACK = 0.4, BACK_MOST = 1.5 * DEGREE;  // off the heading of who stands
constexpr double MAX_STRIDE = 0.06, MAX_TWIST = 6 * DEGREE;  // of a foot of its own
constexpr double STRIDE = 0.05, WIDTH[] = {0.14, 0.26}, LEG_HEIGHT = 0.8;

using Way = std::array<Point, FRAMES>;
using FootPlaces = std::array<Point, SOLES>;

/// A motion in the plane: about `centre` by `turn`, then by `shift`.
struct Planar {
  Point centre;
  double turn;
  Point shift;

  /// A point moved by a share of it.
  Point moved(Point p, double share) const { return turned(p - centre, share * turn) + centre + share * shift; }
};

FootPlaces foot(const SolePlaces& soles, std::size_t side) {
  FootPlaces places;
  std::copy_n(soles.begin() + static_cast<std::ptrdiff_t>(SOLES * side), SOLES, places.begin());
  return places;
}

template <class Places>
Point mean(const Places& places) {
  Point sum;
  for (const Point& place : places) sum = sum + place;
  return (1.0 / static_cast<double>(places.size())) * sum;
}

// the motion that brings points nearest to where they are wanted, within bounds
template <class Places>
Planar nearest(const Places& found, const Places& wanted, double most, double most_turn) {
  const Point centre = mean(found), goal = mean(wanted);
  double crossed = 0, dotted = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    crossed += cross(found[k] - centre, wanted[k] - goal);
    dotted += dot(found[k] - centre, wanted[k] - goal);
  }
  const Point shift = goal - centre;
  const double share = std::min(1.0, most / std::max(length(shift), 1e-9));
  return {centre, bounded(std::atan2(crossed, dotted), -most_turn, most_turn), share * shift};
}

// radians by which a step turns who faces elsewhere back to the heading
double back_to(Point facing, Point asked) {
  const double off = turn_to(facing, asked);
  return bounded(BACK * (off - bounded(off, -AWRY, AWRY)), -BACK_MOST, BACK_MOST);
}

Seed end_of(const Step& step) {
  Seed seed;
  for (std::size_t s = 0; s < SEED; ++s) {
    const std::size_t t = FRAMES - SEED + s;
    seed.hips[s] = rounded(step.hips[t]);
    for (std::size_t j = 0; j < JOINTS; ++j) seed.turns[s][j] = rounded(step.turns[t][j]);
  }
  seed.markers = step.markers;
  return seed;
}

// way of each frame of a body whose velocity changes evenly
Way way_of(Point before, Point after) {
  Way way;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const double share = double(t + 1) / FRAMES;
    way[t] = STEP_SECONDS * share * (before + (share / 2) * (after - before));
  }
  return way;
}

// places for soles found: feet together, a foot that is left behind comes up
SolePlaces closed(SolePlaces soles, Point facing) {
  const Point between = mean(foot(soles, 1)) - mean(foot(soles, 0)), aside{facing.y, -facing.x};
  const double ahead = dot(between, facing), apart = dot(between, aside);
  const double close = std::abs(ahead) > STRIDE ? std::abs(ahead) : 0;
  const double wide = bounded(apart, WIDTH[0], WIDTH[1]) - apart;
  for (std::size_t k = 0; k < soles.size(); ++k) {
    const bool left = k < SOLES, behind = left ? ahead > 0 : ahead < 0;
    soles[k] = soles[k] + (behind ? close : 0) * facing + ((left ? -wide : wide) / 2) * aside;
  }
  return soles;
}

// metres to a sole: its line from heel to toe
double to_sole(Point p, const SolePlaces& soles, std::size_t heel) {
  const Point line = soles[heel + SOLES - 1] - soles[heel];
  const double along = bounded(dot(p - soles[heel], line) / std::max(dot(line, line), 1e-6), 0, 1);
  return length(p - soles[heel] - along * line);
}

// markers with each leg bent so that its sole ends at its place
Markers bent(Markers markers, const SoleMarkers& soles, const SolePlaces& places) {
  const SolePlaces found = sole_places(markers, markers.size() / SEED, soles);
  const auto own = [&](std::size_t side) {
    return nearest(foot(found, side), foot(places, side), MAX_STRIDE, MAX_TWIST);
  };
  const Planar left = own(0), right = own(1);
  for (Vec3& marker : markers) {
    const Point p = floor_of(marker);
    const double to_left = to_sole(p, found, 0), to_right = to_sole(p, found, SOLES);
    const double share = bounded(2 * to_left / std::max(to_left + to_right, 1e-6) - 0.5, 0, 1);
    const double low = bounded(1 - marker.z / LEG_HEIGHT, 0, 1);
    const Point moved = left.moved(p, low * (1 - share)) + right.moved(p, low * share) - p;
    marker = rounded(Vec3{moved.x, moved.y, marker.z});
  }
  return markers;
}

Vec3 at(Point p, double z) { return {p.x, p.y, z}; }

}  // namespace

SolePlaces sole_places(const Markers& markers, std::size_t from, const SoleMarkers& soles) {
  SolePlaces places;
  for (std::size_t k = 0; k < soles.size(); ++k)
    places[k] = floor_of(markers[from + static_cast<std::size_t>(soles[k])]);
  return places;
}

Planted plant(const SoleMarkers& soles, Gait gait, const Seed& seed, Point facing, const Step& made, Point carried) {
  const bool on_the_spot = gait.mode == STANDING || gait.mode == STRAFING || (gait.mode == STOPPING && gait.planted);
  const bool touch = std::all_of(made.contacts.begin(), made.contacts.end(), [](auto& both) { return both[0] && both[1]; });
  Planted result{gait, made, end_of(made)};
  if (!on_the_spot || !touch) {
    result.gait.planted = false;
    result.gait.carried = {};
    return result;
  }
  Step& step = result.step;
  const SolePlaces places =
      gait.planted ? gait.soles : closed(sole_places(seed.markers, seed.markers.size() / SEED, soles), facing);
  const Way way = way_of(gait.carried, carried);
  const Point end = way.back();
  result.gait.planted = true;
  result.gait.carried = carried;
  for (std::size_t k = 0; k < places.size(); ++k) result.gait.soles[k] = places[k] + end;

  Planar both = nearest(sole_places(made.markers, made.markers.size() / SEED, soles), places, MAX_SHIFT, MAX_TURN);
  if (gait.mode == STANDING) both.turn += back_to(facing_of(made.turns.back()[0]), gait.stop_facing);
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const double ease = 0.5 - 0.5 * std::cos(PI * double(t + 1) / FRAMES);
    step.hips[t] = at(both.moved(floor_of(made.hips[t]), ease) + way[t], made.hips[t].z);
    step.turns[t][0] = multiply(about_z(ease * both.turn), made.turns[t][0]);
  }
  for (std::size_t s = 0; s < SEED; ++s) {
    const Vec3& hips = made.hips[FRAMES - SEED + s];
    result.seed.hips[s] = rounded(at(both.moved(floor_of(hips), 1) + end, hips.z));
    result.seed.turns[s][0] = rounded(multiply(about_z(both.turn), made.turns[FRAMES - SEED + s][0]));
  }
  for (Vec3& marker : step.markers) marker = rounded(at(both.moved(floor_of(marker), 1) + end, marker.z));
  result.seed.markers = bent(step.markers, soles, result.gait.soles);
  return result;
}

void shorten(double before, double after, Point start, Planted& planted) {
  if (before == 0 && after == 0) return;
  Point off, last = start;
  for (std::size_t t = 0; t < FRAMES; ++t) {
    const double share = before + double(t + 1) / FRAMES * (after - before);
    Vec3& hips = planted.step.hips[t];
    const Point place = floor_of(hips);
    off = off - share * (place - last);
    last = place;
    hips = hips + at(off, 0);
  }
  for (Vec3& marker : planted.seed.markers) marker = rounded(marker + at(off, 0));
  for (Vec3& hips : planted.seed.hips) hips = rounded(hips + at(off, 0));
}

}  // namespace wayfarer::local
