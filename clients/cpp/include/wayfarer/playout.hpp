// The moment to show, and the pose at it: clients/README.md, "Playout". Times are seconds; no clock is read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace wayfarer {

/// The minimum of the last `seconds`.
class WindowLeast {
 public:
  explicit WindowLeast(double seconds) : seconds_(seconds), pairs_(1024) {}
  void add(double now, double value);
  /// NaN when there is none.
  double least(double now);

 private:
  struct Pair {
    double time, value;
  };
  Pair& at(std::size_t k) { return pairs_[(first_ + k) & (pairs_.size() - 1)]; }
  void grow();

  double seconds_;
  std::vector<Pair> pairs_;  // a ring: values rise from oldest to newest
  std::size_t first_ = 0, count_ = 0;
};

/// Chooses the moment of the stream (server time) to show now, for all agents alike.
class PlayoutClock {
 public:
  /// Note a message that came at local `now`, sent at server time `sent_at`.
  void observe(double now, double sent_at);
  /// Note a chunk that came at local `now`, whose first frame is for `scheduled_at`.
  void observe_chunk(double now, double scheduled_at);
  /// Note that a connection was restored; its header was sent at server time `sent_at`. Chunks for earlier times were
  /// missed meanwhile; their lateness predicts nothing.
  void resumed(double sent_at) { caught_up_at_ = sent_at; }
  /// The server's clock at local `now`, as if the fastest message had taken no time.
  double server_time(double now) const { return known(offset_) ? now - offset_ : now; }
  /// The target delay, seconds.
  double wanted_delay(double now);
  /// The present delay, seconds.
  double delay(double now) { return known(playhead_) ? server_time(now) - playhead_ : wanted_delay(now); }
  /// Advance to local `now`; returns the moment to show, in server time.
  double advance(double now);

 private:
  static constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
  static bool known(double value) { return value == value; }

  WindowLeast transit_{30};    // local - server time of each message
  WindowLeast earliness_{20};  // of each chunk; negative when late
  double offset_ = NONE, playhead_ = NONE, last_ = 0, caught_up_at_ = NONE;
};

/// The frames of one agent, and its pose at moments that never go back.
class PoseTrack {
 public:
  /// `width`: numbers per frame: hips x, y, z, then x, y, z, w per bone.
  explicit PoseTrack(std::size_t width) : width_(width) {}

  /// Add `count` frames that stand one behind the other, the first of which is for `time`, with a byte of contacts
  /// each. Known ones are dropped.
  void push(double time, double fps, const float* frames, std::size_t count, const std::uint8_t* contacts);
  /// Write the pose at `time` into `out` [width]; false when no frame has come yet.
  bool sample(double time, float* out);
  /// Seconds of frames after `time`; negative when they have run out.
  double buffered(double time) const;

  std::size_t width() const { return width_; }
  /// Number of frames in the queue.
  std::size_t size() const { return count_; }
  /// How often frames ran out.
  std::size_t underruns() const { return underruns_; }
  /// Bits of the frame at or before the moment shown: 1 left foot, 2 right foot.
  std::uint8_t contacts() const { return shown_contacts_; }
  /// Whether frames have run out, and the last one is shown.
  bool held() const { return dry_; }

 private:
  std::size_t slot(std::size_t k) const { return (first_ + k) & (times_.size() - 1); }
  const float* frame(std::size_t k) const { return &frames_[width_ * slot(k)]; }
  void drop();
  void grow();
  void between(double time, float* out) const;

  std::size_t width_;
  std::vector<double> times_;  // rings
  std::vector<float> frames_;
  std::vector<std::uint8_t> contacts_;
  std::size_t first_ = 0, count_ = 0, underruns_ = 0;
  std::uint8_t shown_contacts_ = 0;
  bool dry_ = false, starving_ = false;
  double held_at_ = std::numeric_limits<double>::quiet_NaN();  // NaN: there is no blend
  std::vector<float> held_, shown_;  // pose to blend from; pose shown last
};

/// out = between poses a and b: hips on a line, rotations along the shorter arc. `out` may be one of them.
void mix_poses(const float* a, const float* b, double share, float* out, std::size_t width);

}  // namespace wayfarer
