// One person: the motion that is planned and that which is sent, goals, and what a step makes of them. The server's
// world/stepping (scheduler, playback), for one person. Time: frames, 40 a second.
#pragma once

#include <deque>

#include "footlock.hpp"
#include "model.hpp"
#include "random.hpp"

namespace wayfarer::local {

/// Motion between two steps.
struct Motion {
  Seed seed;
  Gait gait;
};

/// Eight frames that are planned, and what comes after them.
struct Planned {
  int seq, flags, goal_revision;
  bool last, through;  // of the goal: the path ends there; it is passed
  FrameHips hips;
  FrameTurns turns;
  std::array<std::array<bool, 2>, FRAMES> contacts;  // left, right
  Motion end;
};

/// The request for the next step.
struct Asked {
  Start start;
  Gait gait;
  GoalRow goal;
  Targets targets;
  std::array<float, LATENT> noise;
};

class Person {
 public:
  /// `model` and `steering` outlive it. `start`: world frame of the first frame.
  Person(const LocalSpec& spec, const LocalModel::Parts& model, const Steering& steering, double start);

  const LocalSpec spec;
  const bool mirrored;
  const std::array<float, LATENT> own_noise;
  const std::array<float, TRAITS> manner;

  /// World frame by which the next chunk has to be planned, and at which the next planned one is sent; or infinity.
  double plan_frame() const;
  double send_frame() const;
  /// World frame of a chunk's first frame.
  double shown(int seq) const;
  const Seed& seed() const { return planned_.seed; }
  std::array<Vec3, JOINTS> bones() const { return body_.bones(spec.betas); }

  void give(const std::vector<LocalGoal>& goals, double frame);
  void append(const std::vector<LocalGoal>& goals, double frame);
  Asked next() const;
  /// Plan a chunk from what the engine has made.
  void take(const Asked& asked, Step made);
  /// Take out the next chunk.
  Planned send();

 private:
  const Body& body_;
  const SoleMarkers& soles_;
  const std::vector<double>& shares_;
  const std::vector<Feet<LegShare>>& leg_shares_;
  const Steering& steering_;
  const Legs legs_;
  const int reaction_;
  std::deque<Planned> queue_;   // planned, not sent
  bool replanned_ = false;
  Motion planned_, committed_;
  int planned_chunks_ = 0, sent_chunks_ = 0;
  double start_;
  int revision_ = 0;
  std::vector<LocalGoal> goals_;
  std::vector<GoalRow> path_;
  Point from_;  // where the path begins

  void replan(double until);
  Motion stand(Point place, double heading) const;
};

}  // namespace wayfarer::local
