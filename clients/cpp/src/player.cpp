#include "wayfarer/player.hpp"

#include <algorithm>

namespace wayfarer {
namespace {

constexpr std::size_t MAX_BONES = 1024;  // a header's, so that no server fills this machine's memory

}  // namespace

MessageKind MotionPlayer::receive(const std::uint8_t* message, std::size_t size, double now) {
  const MessageKind kind = decoder_.decode(message, size);
  ++stats_.messages;
  stats_.bytes += size;
  if (kind == MessageKind::header) take_header();
  clock_.observe(now, decoder_.sent_at());
  if (kind == MessageKind::batch) take_batch(now);
  else if (kind == MessageKind::event && on_.event) on_.event(decoder_.event());
  return kind;
}

double MotionPlayer::advance(double now) {
  moment_ = clock_.advance(now);
  for (auto& [alias, played] : agents_) played.shown = played.track.sample(moment_, played.frame.data());
  return moment_;
}

void MotionPlayer::clear() {
  while (!agents_.empty()) remove(agents_.begin()->first);
  clock_ = PlayoutClock();
}

void MotionPlayer::remove(std::uint32_t alias) {
  auto gone = agents_.extract(alias);
  if (!gone) return;
  gone_underruns_ += gone.mapped().track.underruns();
  if (on_.removed) on_.removed(gone.mapped());
}

std::size_t MotionPlayer::underruns() const {
  std::size_t sum = gone_underruns_;
  for (const auto& [alias, played] : agents_) sum += played.track.underruns();
  return sum;
}

double MotionPlayer::buffered() const {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [alias, played] : agents_) least = std::min(least, played.track.buffered(moment_));
  return least;
}

void MotionPlayer::take_header() {
  const Header& header = decoder_.header();
  if (header.bones.size() > MAX_BONES) throw DecodeError(std::to_string(header.bones.size()) + " bones are too many");
  TierUnpacker tiers(header);  // before anything is changed: it may refuse the header
  const bool again = header_.has_value();
  header_ = header;
  tiers_ = std::move(tiers);
  begun_ = true;
  if (again) clock_.resumed(decoder_.sent_at());
  if (on_.header) on_.header(*header_, again);
}

void MotionPlayer::take_batch(double now) {
  if (!begun_) throw DecodeError("motion came before the header");
  decoder_.check_frames(*header_);
  const std::size_t width = frame_width(header_->bones.size());
  for (const Agent& agent : decoder_.added()) add(agent, width);
  for (std::size_t row = 0; row < decoder_.chunks(); ++row) take_chunk(decoder_.chunk(row), width, now);
  for (const std::uint64_t alias : decoder_.removed()) remove(static_cast<std::uint32_t>(alias));
  for (const std::uint64_t alias : decoder_.hidden()) {
    const auto found = agents_.find(static_cast<std::uint32_t>(alias));
    if (found != agents_.end()) found->second.hidden = true;
    remove(static_cast<std::uint32_t>(alias));
  }
}

/// A new agent, or a known one when a stream begins again.
void MotionPlayer::add(const Agent& agent, std::size_t width) {
  const auto known = agents_.find(agent.alias);
  if (known != agents_.end()) {
    if (known->second.agent.id == agent.id && known->second.track.width() == width) return;
    remove(agent.alias);
  }
  PlayedAgent& played = agents_.try_emplace(agent.alias, agent, width).first->second;
  if (on_.added) on_.added(played);
}

void MotionPlayer::take_chunk(const Chunk& chunk, std::size_t width, double now) {
  ++stats_.chunks;
  stats_.frames += chunk.frames;
  stats_.gaps += (chunk.flags & flag::GAP) != 0;
  stats_.reduced += (chunk.flags & flag::REDUCED) != 0;
  stats_.held += (chunk.flags & flag::HELD) != 0;
  const auto found = agents_.find(chunk.alias);
  if (found == agents_.end()) return;  // removed here, its last chunks still on the way
  PlayedAgent& played = found->second;
  if (played.track.width() != width) return;  // a stream in another format did not introduce it again
  clock_.observe_chunk(now, chunk.scheduled_at);
  if (unpacked_.size() < chunk.frames * width) unpacked_.resize(chunk.frames * width);
  const std::size_t tier = decoder_.tier();
  tiers_->unpack(chunk.poses, chunk.frames, tier, unpacked_.data());
  played.track.push(chunk.scheduled_at, header_->tiers[tier].sent_fps, unpacked_.data(), chunk.frames, chunk.contacts);
  played.state = chunk.state;
  played.tier = tier;
  if (on_.chunk) on_.chunk(played, chunk);
}

}  // namespace wayfarer
