// Counts calls of operator new over 10,000 chunks that are received, sampled, put on characters and followed by a smooth
// root, after warm-up. Prints them, and the time; fails when there is one.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <new>

#include "crowd.hpp"

namespace {
std::size_t allocated = 0;

void* counted(std::size_t size) {
  ++allocated;
  if (void* found = std::malloc(size ? size : 1)) return found;
  throw std::bad_alloc();
}
}  // namespace

void* operator new(std::size_t size) { return counted(size); }
void* operator new[](std::size_t size) { return counted(size); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }

int main() {
  using namespace wayfarer;
  constexpr std::size_t AGENTS = 64, WARM = 120, COUNTED = (10000 + AGENTS - 1) / AGENTS, PICTURES = 12;
  struct Character {
    Retarget retarget;
    SmoothRoot root;
  };
  const golden::Walk walk = golden::walk("gltf");
  const std::vector<golden::Case> cases = golden::cases();
  std::map<std::uint32_t, Character> characters;
  PlayerEvents on;
  on.added = [&](PlayedAgent& played) {
    const golden::Case& own = cases[played.agent.alias % 13];  // those in the glTF basis
    const BoneMap map = map_bones(own.rig, own.humanoid);
    characters.emplace(played.agent.alias,
                       Character{Retarget(map, played.agent.rest_offsets), SmoothRoot(bases::gltf)});
  };
  MotionPlayer player(on);
  std::vector<golden::Bytes> messages;
  for (std::size_t seq = 0; seq < WARM + COUNTED; ++seq) messages.push_back(crowd::batch(walk, AGENTS, seq));
  const golden::Bytes header = crowd::header();
  player.receive(header.data(), header.size(), 100);

  double checksum = 0;
  const auto play = [&](std::size_t seq) {
    const double now = 100 + 0.2 * static_cast<double>(seq);
    player.receive(messages[seq].data(), messages[seq].size(), now);
    for (std::size_t k = 0; k < PICTURES; ++k) {
      const double moment = player.advance(now + 0.2 * static_cast<double>(k) / PICTURES);
      for (const auto& [alias, played] : player.agents()) {
        Character& character = characters.at(alias);
        character.retarget.pose(played.frame.data());
        character.root.update(moment, played.frame.data(), 0);
        checksum += character.retarget.place(0).x;
      }
    }
  };
  for (std::size_t seq = 0; seq < WARM; ++seq) play(seq);
  const std::size_t before = allocated;
  const auto begun = std::chrono::steady_clock::now();
  for (std::size_t seq = WARM; seq < messages.size(); ++seq) play(seq);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begun;
  const std::size_t counted_now = allocated - before;
  std::printf("{\"chunks\": %zu, \"allocations\": %zu, \"allocations before\": %zu, \"underruns\": %zu, "
              "\"ms per picture of %zu agents\": %.3f}\n",
              AGENTS * COUNTED, counted_now, before, player.underruns(), AGENTS,
              took.count() / static_cast<double>(COUNTED * PICTURES));
  const bool played = player.stats().chunks == AGENTS * (WARM + COUNTED) && checksum == checksum;
  return counted_now == 0 && before > 0 && played && player.underruns() == 0 ? 0 : 1;
}
