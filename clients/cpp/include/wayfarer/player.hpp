// The agents of a stream, played smoothly: messages and times go in, poses come out.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "wayfarer/messages.hpp"
#include "wayfarer/playout.hpp"
#include "wayfarer/tiers.hpp"

namespace wayfarer {

/// An agent, as it is shown.
struct PlayedAgent {
  PlayedAgent(const Agent& introduced, std::size_t width)
      : agent(introduced), frame(width), track(width) {}

  Agent agent;
  std::vector<float> frame;  // hips x, y, z, then x, y, z, w for each of the header's bones
  PoseTrack track;
  bool hidden = false;  // taken away since it has left the last ring; it may come again
  std::size_t tier = 0;  // number of the ring that it is in: of the last chunk
  bool shown = false;  // whether there is a pose in `frame`
  AgentState state = AgentState::standing;  // of the last chunk
};

/// What a player tells, all as it comes; `removed` also of who has left the last ring and is `hidden`. A callback must not
/// call the player.
struct PlayerEvents {
  std::function<void(const Header&, bool again)> header;
  std::function<void(PlayedAgent&)> added, removed;
  std::function<void(PlayedAgent&, const Chunk&)> chunk;
  std::function<void(const Event&)> event;
};

/// Counted since the start; `gaps`, `reduced`, `held`: chunks with that flag.
struct PlayerStats {
  std::uint64_t messages = 0, bytes = 0, chunks = 0, frames = 0, gaps = 0, reduced = 0, held = 0;
};

/// Plays a stream. Times are seconds of any clock of this machine. Allocates nothing but for agents that are new.
/// One thread at a time.
class MotionPlayer {
 public:
  explicit MotionPlayer(PlayerEvents on = {}) : on_(std::move(on)) {}

  /// A connection begins: its first message is a header.
  void begin() { begun_ = false; }
  /// A message of the stream has come at local `now`. Throws DecodeError: the connection is of no more use then.
  MessageKind receive(const std::uint8_t* message, std::size_t size, double now);
  /// Show everybody as at local `now`. Returns the moment shown, in server time.
  double advance(double now);
  /// Forget everybody, as if they were removed, and the clock.
  void clear();
  /// Forget an agent.
  void remove(std::uint32_t alias);

  /// By alias; their addresses stay until they are removed.
  const std::map<std::uint32_t, PlayedAgent>& agents() const { return agents_; }
  const std::optional<Header>& header() const { return header_; }
  PlayoutClock& clock() { return clock_; }
  /// The moment shown: server time, seconds since 1970. NaN before the first.
  double moment() const { return moment_; }
  const PlayerStats& stats() const { return stats_; }
  /// What to ask the next stream to go on from; "" at first.
  const std::string& resume_token() const { return decoder_.resume_token(); }
  /// How often an agent's frames ran out.
  std::size_t underruns() const;
  /// Seconds of motion in hand, of the agent that has the least; infinity when there is none.
  double buffered() const;

 private:
  void take_header();
  void take_batch(double now);
  void add(const Agent& agent, std::size_t width);
  void take_chunk(const Chunk& chunk, std::size_t width, double now);

  PlayerEvents on_;
  StreamDecoder decoder_;
  PlayoutClock clock_;
  std::map<std::uint32_t, PlayedAgent> agents_;
  std::optional<Header> header_;
  std::optional<TierUnpacker> tiers_;
  std::vector<float> unpacked_;
  PlayerStats stats_;
  std::size_t gone_underruns_ = 0;
  bool begun_ = false;
  double moment_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace wayfarer
