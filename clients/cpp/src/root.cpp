#include "wayfarer/root.hpp"

#include <cmath>

namespace wayfarer {
namespace {

constexpr double SMOOTHING = 0.3;  // seconds: time constant of the critically damped filter
constexpr double PAUSE = 2;        // seconds between samples beyond which it begins again at that place
constexpr double TURN = 2 * 3.141592653589793;

}  // namespace

void SmoothRoot::Follower::follow(double target, double step, double jump) {
  if (value != value || step > PAUSE || std::abs(target - value) > jump) {
    value = target;
    rate = 0;
  } else if (step > 0) {
    const double theta = std::exp(-step / SMOOTHING);
    const double ahead = value + rate * step, off = target - ahead;
    value = ahead + (1 - theta * theta) * off;
    rate += (1 - theta) * (1 - theta) / step * off;
  }
}

void SmoothRoot::update(double time, const float* frame, double ground) {
  const double step = last_ == last_ ? std::max(0.0, time - last_) : 0;
  last_ = time;
  const Vec3 hips{frame[0], frame[1], frame[2]};
  double heading = basis_.heading({frame[3], frame[4], frame[5], frame[6]});
  if (heading_.value == heading_.value) heading += TURN * std::round((heading_.value - heading) / TURN);
  left_.follow(dot(hips, basis_.left), step, jump_);
  forward_.follow(dot(hips, basis_.forward), step, jump_);
  up_.follow(ground, step, jump_);
  heading_.follow(heading, step, std::numeric_limits<double>::infinity());
  point_ = left_.value * basis_.left + forward_.value * basis_.forward + up_.value * basis_.up;
}

}  // namespace wayfarer
