// Numbers that follow from a person's seed, the same as the server's (world/agents/style.py, mirror.py).
#pragma once

#include <array>
#include <cstdint>

namespace wayfarer::local {

constexpr int LATENT = 128;
constexpr int TRAITS = 8;  // numbers of a manner

/// The step, of `moments` in turn, with which a person sets off.
int reaction_of(std::uint64_t seed, int moments);
/// Whether the model moves the person's mirror image: half of all seeds.
bool is_mirrored(std::uint64_t seed);
/// A latent ~ N(0, I), fixed for each person.
std::array<float, LATENT> own_noise_of(std::uint64_t seed);
/// A manner ~ N(0, I), fixed for each person.
std::array<float, TRAITS> manner_of(std::uint64_t seed);
/// A latent ~ N(0, I) for a chunk of a person.
std::array<float, LATENT> noise_of(std::uint64_t seed, int chunk);

}  // namespace wayfarer::local
