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

  /// Clean a chunk in place.
  Contacts clean(const FrameHips& hips, FrameTurns& turns);

 private:
  struct State {
    Feet<Soles> soles;  // where the model had them in the last frame
    Feet<bool> contact{};
    Feet<double> hold{};
    Feet<Vec3> shift;
  };

  State begin(const Vec3& hips, const Turns& turns) const;

  Legs legs_;
  std::optional<State> state_;
};

}  // namespace wayfarer::local
