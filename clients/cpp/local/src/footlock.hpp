// Feet that bear weight stay where they are, in what is shown. The server's world/output/footlock.py, for one person:
// what its rules are for is told there.
#pragma once

#include <optional>

#include "guards.hpp"

namespace wayfarer::local {

using Contacts = std::array<std::array<bool, 2>, FRAMES>;  // left, right

/// Locks the feet of one person, chunk after chunk.
class FootLock {
 public:
  explicit FootLock(const Legs& legs) : legs_(legs) {}

  /// Forget the past: the next chunk starts in another pose.
  void restart() { state_.reset(); }

  /// Clean a chunk in place. `steps`: the person is on the spot, where feet step, and `waits` with it who comes to a
  /// stand. `shortened`: the share that the way of the hips is shortened by at its end. `upright`: how far the person
  /// has straightened the knees in each frame.
  Contacts clean(FrameHips& hips, FrameTurns& turns, bool steps, bool waits, double shortened,
                 const std::array<double, FRAMES>& upright);

  /// Steps as long as the way of the hips, without a lock.
  void shorten_steps(const FrameHips& hips, FrameTurns& turns, double shortened);

 private:
  using Poses = std::array<LegPose, FRAMES>;

  struct State {
    Feet<Soles> soles;  // where the model had them in the last frame
    Feet<bool> contact{};
    Feet<double> hold{}, turn{};
    Feet<Vec3> shift, aim;  // of aim: x, y and turn
    Feet<int> swing{};      // frames that a step still takes
    double shortened = 0;
    Feet<double> reach{};
    double evened = 0;
  };

  /// Way of ankles along the facing where steps are shortened, and evened; how far along they are; length of steps.
  struct Drawn {
    std::array<Feet<Point>, FRAMES> way;
    std::array<Feet<double>, FRAMES> along;
    std::array<double, FRAMES> stride;
  };

  /// Of a foot from frame to frame: way of its bearing points, turn, height, speed.
  struct Slide {
    Point way;
    double turn, height, speed;
  };
  using Slides = std::array<Feet<Slide>, FRAMES>;

  State begin(const Vec3& hips, const Turns& turns) const;
  Poses poses(const FrameHips& hips, const FrameTurns& turns) const;
  static Drawn draw_in(const Poses& poses, State& state, bool steps, double shortened, bool evens);
  static Slides slides(const Poses& poses, const Feet<Soles>& before, bool steps);
  static void set_out(State& state, bool steps, double bound, Point across);
  double sink(const LegPose& pose, const Feet<Point>& drawn, const Vec3& hips, const Feet<Slide>& feet,
              double upright, Feet<Vec3>& shifts) const;
  static Point sway(const LegPose& pose, const Feet<double>& along, double stride, const Feet<Slide>& feet);

  Legs legs_;
  std::optional<State> state_;
  double shortened_ = 0;  // of the last step, also while the lock is off
};

}  // namespace wayfarer::local
