#include "wayfarer/playout.hpp"

#include <algorithm>
#include <cmath>

namespace wayfarer {
namespace {

constexpr double FIRST_DELAY = 0.35, MIN_DELAY = 0.2, MAX_DELAY = 1.5;
constexpr double MARGIN = 0.06;     // over the worst lateness of the window
constexpr double STRETCH = 0.05;    // playback runs at most this much faster or slower
constexpr double JUMP = 1.0;        // error in seconds beyond which it jumps instead (after a sleep)
constexpr double BLEND = 0.2;       // seconds to blend from a held pose to the stream again
constexpr std::size_t KEPT = 400;   // most frames of an agent
constexpr std::size_t FIRST_ROOM = 32;

}  // namespace

void WindowLeast::add(double now, double value) {
  while (count_ && at(count_ - 1).value >= value) --count_;
  if (count_ == pairs_.size()) grow();
  at(count_++) = {now, value};
}

double WindowLeast::least(double now) {
  while (count_ && at(0).time < now - seconds_) {
    first_ = (first_ + 1) & (pairs_.size() - 1);
    --count_;
  }
  return count_ ? at(0).value : std::numeric_limits<double>::quiet_NaN();
}

void WindowLeast::grow() {
  std::vector<Pair> wider(2 * pairs_.size());
  for (std::size_t k = 0; k < count_; ++k) wider[k] = at(k);
  pairs_.swap(wider);
  first_ = 0;
}

void PlayoutClock::observe(double now, double sent_at) {
  // at first, expect as much as the first delay allows
  if (!known(offset_)) earliness_.add(now, MARGIN - FIRST_DELAY);
  transit_.add(now, now - sent_at);
  offset_ = transit_.least(now);
}

void PlayoutClock::observe_chunk(double now, double scheduled_at) {
  if (!(scheduled_at < caught_up_at_)) earliness_.add(now, scheduled_at - server_time(now));
}

double PlayoutClock::wanted_delay(double now) {
  const double earliness = earliness_.least(now);
  return known(earliness) ? std::clamp(MARGIN - earliness, MIN_DELAY, MAX_DELAY) : MIN_DELAY;
}

double PlayoutClock::advance(double now) {
  if (!known(offset_)) return now;  // nothing has come yet
  const double ideal = server_time(now) - wanted_delay(now);
  if (!(std::abs(ideal - playhead_) <= JUMP)) {
    playhead_ = ideal;
  } else {
    const double step = std::max(0.0, now - last_);
    const double off = ideal - (playhead_ + step);
    playhead_ += step + std::clamp(off, -STRETCH * step, STRETCH * step);
  }
  last_ = now;
  return playhead_;
}

void PoseTrack::push(double time, double fps, const float* frames, std::size_t count,
                     const std::uint8_t* contacts) {
  const double last = count_ ? times_[slot(count_ - 1)] : -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < count; ++k) {
    const double when = time + static_cast<double>(k) / fps;
    if (when <= last + 0.25 / fps) continue;
    if (count_ == KEPT) drop();
    else if (count_ == times_.size()) grow();
    const std::size_t free = slot(count_++);
    times_[free] = when;
    contacts_[free] = contacts[k];
    std::copy_n(frames + width_ * k, width_, &frames_[width_ * free]);
  }
}

bool PoseTrack::sample(double time, float* out) {
  if (!count_) return false;
  // one frame before `time` stays, to interpolate from
  while (count_ > 1 && times_[slot(1)] <= time) drop();
  dry_ = count_ == 1 && time > times_[first_];
  if (dry_) {
    if (!starving_) ++underruns_;
    starving_ = true;
  } else if (starving_ && count_ > 1) {
    starving_ = false;
    held_.swap(shown_);
    held_at_ = time;
  }
  between(time, out);
  const double share = (time - held_at_) / BLEND;
  if (share >= 1) held_at_ = std::numeric_limits<double>::quiet_NaN();
  else if (share == share) mix_poses(held_.data(), out, share * share * (3 - 2 * share), out, width_);
  std::copy_n(out, width_, shown_.data());
  shown_contacts_ = contacts_[first_];
  return true;
}

double PoseTrack::buffered(double time) const {
  return count_ ? times_[slot(count_ - 1)] - time : -std::numeric_limits<double>::infinity();
}

void PoseTrack::between(double time, float* out) const {
  const double before = times_[first_];
  if (count_ == 1 || time <= before) {
    std::copy_n(frame(0), width_, out);
    return;
  }
  mix_poses(frame(0), frame(1), (time - before) / (times_[slot(1)] - before), out, width_);
}

void PoseTrack::drop() {
  first_ = slot(1);
  --count_;
}

void PoseTrack::grow() {
  const std::size_t room = times_.empty() ? FIRST_ROOM : 2 * times_.size();
  std::vector<double> times(room);
  std::vector<float> frames(room * width_);
  std::vector<std::uint8_t> contacts(room);
  for (std::size_t k = 0; k < count_; ++k) {
    times[k] = times_[slot(k)];
    contacts[k] = contacts_[slot(k)];
    std::copy_n(frame(k), width_, &frames[width_ * k]);
  }
  times_.swap(times);
  frames_.swap(frames);
  contacts_.swap(contacts);
  held_.resize(width_);
  shown_.resize(width_);
  first_ = 0;
}

void mix_poses(const float* a, const float* b, double share, float* out, std::size_t width) {
  for (std::size_t k = 0; k < 3; ++k) {
    const double from = a[k];
    out[k] = static_cast<float>(from + (b[k] - from) * share);
  }
  for (std::size_t k = 3; k + 4 <= width; k += 4) {
    double cosine = 0;
    for (std::size_t n = k; n < k + 4; ++n) cosine += static_cast<double>(a[n]) * b[n];
    const double sign = cosine < 0 ? -1 : 1;
    cosine *= sign;
    double from_a = 1 - share, from_b = share * sign;
    if (cosine < 0.9995) {
      const double angle = std::acos(cosine), sine = std::sin(angle);
      from_a = std::sin((1 - share) * angle) / sine;
      from_b = std::sin(share * angle) / sine * sign;
    }
    double mixed[4], squares = 0;
    for (std::size_t n = 0; n < 4; ++n) {
      mixed[n] = a[k + n] * from_a + b[k + n] * from_b;
      squares += mixed[n] * mixed[n];
    }
    const double size = squares > 0 ? std::sqrt(squares) : 1;
    for (std::size_t n = 0; n < 4; ++n) out[k + n] = static_cast<float>(mixed[n] / size);
  }
}

}  // namespace wayfarer
