// Malformed messages: each is refused or read, within its bytes (the sanitizers look). Messages are valid ones with bytes
// changed, cut, inserted and repeated; the same in every run.

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>

#include "crowd.hpp"

using golden::Bytes;

namespace {

void mutate(Bytes& bytes, std::mt19937& random, const std::vector<Bytes>& seeds) {
  const auto below = [&](std::size_t most) { return random() % (most ? most : 1); };
  static const std::uint8_t SPECIAL[]{0, 1, 2, 7, 8, 0x0a, 0x12, 0x1a, 0x7f, 0x80, 0xff};
  for (std::size_t count = 1 + below(4); count; --count) {
    const std::size_t at = below(bytes.size());
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    switch (below(6)) {
      case 0: if (!bytes.empty()) *place = static_cast<std::uint8_t>(random()); break;
      case 1: if (!bytes.empty()) *place = SPECIAL[below(sizeof SPECIAL)]; break;
      case 2: if (!bytes.empty()) *place = static_cast<std::uint8_t>(*place ^ 1u << below(8)); break;
      case 3: bytes.resize(at); break;
      case 4: bytes.insert(place, SPECIAL[below(sizeof SPECIAL)]); break;
      default: {
        const Bytes& other = seeds[below(seeds.size())];
        const std::size_t from = below(other.size()), size = below(std::min<std::size_t>(64, other.size() - from) + 1);
        bytes.insert(place, other.begin() + static_cast<std::ptrdiff_t>(from),
                     other.begin() + static_cast<std::ptrdiff_t>(from + size));
      }
    }
  }
}

}  // namespace

int main(int count, char** values) {
  using namespace wayfarer;
  const long rounds = count > 1 ? std::atol(values[1]) : 20000;
  std::vector<Bytes> seeds;
  for (const char* name : {"header", "header_small", "header_tiers", "batch", "batch_small", "batch_root",
                           "batch_closer", "event", "heartbeat"})
    seeds.push_back(golden::message(name));
  const golden::Walk walk = golden::walk("gltf");
  seeds.push_back(crowd::header());
  seeds.push_back(crowd::batch(walk, 3, 0));
  seeds.push_back(crowd::batch(walk, 3, 1));
  std::mt19937 random(20261123);
  long refused = 0, read = 0, shown = 0;
  for (long round = 0; round < rounds;) {
    MotionPlayer player;
    double now = 0;
    for (int k = 0; k < 40; ++k, ++round) {
      Bytes bytes = seeds[k < 2 ? std::size_t(8 + k) : random() % seeds.size()];
      if (k >= 2 && random() % 8) mutate(bytes, random, seeds);
      // in its own block of the exact size: the sanitizer reports a byte beyond it
      const std::unique_ptr<std::uint8_t[]> own(new std::uint8_t[bytes.size()]);
      std::copy(bytes.begin(), bytes.end(), own.get());
      try {
        player.receive(own.get(), bytes.size(), now += 0.1);
        ++read;
      } catch (const DecodeError&) {
        ++refused;
      }
      player.advance(now);
      for (const auto& [alias, played] : player.agents()) shown += played.shown;
    }
  }
  std::printf("{\"read\": %ld, \"refused\": %ld, \"shown\": %ld}\n", read, refused, shown);
  return read && refused && shown ? 0 : 1;
}
