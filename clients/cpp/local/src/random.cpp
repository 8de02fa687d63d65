#include "random.hpp"

#include <cmath>

namespace wayfarer::local {
namespace {

constexpr std::uint64_t STREAM = 0x5741594641524552;  // keeps the noise of steps apart from other draws
constexpr std::uint64_t STEP = 0x9e3779b97f4a7c15;
enum Draw : std::uint64_t { REACTION = 1, OWN, MANNER };  // of one seed; they do not depend on each other

// 64 bits of a seed, spread evenly (the finaliser of SplitMix64)
std::uint64_t mixed(std::uint64_t seed, std::uint64_t draw) {
  std::uint64_t bits = seed + draw * STEP;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111eb;
  return bits ^ (bits >> 31);
}

// the upper 64 bits of a product
std::uint64_t upper(std::uint64_t a, std::uint64_t b) {
  const std::uint64_t mask = 0xffffffff, a0 = a & mask, a1 = a >> 32, b0 = b & mask, b1 = b >> 32;
  const std::uint64_t middle = a1 * b0 + (a0 * b0 >> 32), other = a0 * b1 + (middle & mask);
  return a1 * b1 + (middle >> 32) + (other >> 32);
}

// Philox 4×64-10 (Salmon et al. 2011) as numpy has it: a source of 32 bits, the lower half of each word first.
class Philox {
 public:
  Philox(std::uint64_t key0, std::uint64_t key1, std::uint64_t stream = 0) : key_{key0, key1}, stream_(stream) {}

  std::uint32_t operator()() {
    if (at_ == 8) {
      ++counter_;
      block();
      at_ = 0;
    }
    const std::uint64_t word = words_[at_ / 2];
    return static_cast<std::uint32_t>(at_++ % 2 ? word >> 32 : word);
  }

 private:
  void block() {
    std::uint64_t a = counter_, b = stream_, c = 0, d = 0, key0 = key_[0], key1 = key_[1];
    for (int round = 0; round < 10; ++round) {
      constexpr std::uint64_t M0 = 0xd2e7470ee14c6c93, M1 = 0xca5a826395121157;
      const std::uint64_t first = upper(M0, a), second = upper(M1, c), low0 = M0 * a, low1 = M1 * c;
      a = second ^ b ^ key0;
      c = first ^ d ^ key1;
      b = low1;
      d = low0;
      key0 += STEP;
      key1 += 0xbb67ae8584caa73b;
    }
    words_ = {a, b, c, d};
  }

  std::array<std::uint64_t, 2> key_;
  std::array<std::uint64_t, 4> words_{};
  std::uint64_t counter_ = 0, stream_;
  std::size_t at_ = 8;
};

// The ziggurat method (Marsaglia and Tsang 2000) for float32, 256 layers, as numpy has it.
constexpr double TAIL = 3.6541528853610088, AREA = 0.00492867323397465524494;

double gauss(double x) { return std::exp(-0.5 * x * x); }

struct Layers {
  std::array<double, 256> limit{};
  std::array<float, 256> width{}, density{};

  Layers() {
    double edge = TAIL;
    const double base = AREA / gauss(edge);
    limit[0] = std::floor(edge / base * 8388608);  // 2²³
    width[0] = static_cast<float>(base / 8388608);
    density[0] = 1;
    width[255] = static_cast<float>(edge / 8388608);
    density[255] = static_cast<float>(gauss(edge));
    for (std::size_t k = 254; k >= 1; --k) {
      const double inner = std::sqrt(-2 * std::log(AREA / edge + gauss(edge)));
      limit[k + 1] = std::floor(inner / edge * 8388608);
      width[k] = static_cast<float>(inner / 8388608);
      density[k] = static_cast<float>(gauss(inner));
      edge = inner;
    }
  }
};

float normal(Philox& next) {
  static const Layers layers;
  const auto uniform = [&] { return std::ldexp(static_cast<double>(next() >> 8), -24); };
  for (;;) {
    const std::uint32_t bits = next(), layer = bits & 0xff, size = (bits >> 9) & 0x7fffff;
    const float sign = (bits >> 8) & 1 ? -1.0F : 1.0F;
    const float x = sign * static_cast<float>(double(size) * double(layers.width[layer]));
    if (size < layers.limit[layer]) return x;
    if (layer == 0) {
      for (;;) {
        const double over = -std::log1p(-uniform()) / TAIL, second = -std::log1p(-uniform());
        if (second + second > over * over)
          return static_cast<float>((size >> 8) & 1 ? -(TAIL + over) : TAIL + over);
      }
    }
    const double below = layers.density[layer], above = layers.density[layer - 1];
    if ((above - below) * uniform() + below < gauss(x)) return x;
  }
}

}  // namespace

int reaction_of(std::uint64_t seed, int moments) {
  return static_cast<int>(mixed(seed, REACTION) % static_cast<std::uint64_t>(moments));
}

bool is_mirrored(std::uint64_t seed) { return (seed * STEP) >> 63; }

namespace {

template <std::size_t N>
std::array<float, N> normals(Philox next) {
  std::array<float, N> numbers;
  for (float& number : numbers) number = normal(next);
  return numbers;
}

}  // namespace

std::array<float, LATENT> own_noise_of(std::uint64_t seed) { return normals<LATENT>({seed, OWN}); }
std::array<float, TRAITS> manner_of(std::uint64_t seed) { return normals<TRAITS>({seed, MANNER}); }

std::array<float, LATENT> noise_of(std::uint64_t seed, int chunk) {
  return normals<LATENT>({seed, STREAM, static_cast<std::uint64_t>(chunk)});
}

}  // namespace wayfarer::local
