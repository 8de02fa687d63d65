// People who walk in this program, without a server, on an export of the motion model (`wayfarer export --for engines`).
// World: metres, right-handed, Z up; heading 0 faces +Y. Times: seconds of a clock of the host's.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "wayfarer/bases.hpp"

namespace wayfarer {

/// That of these people: for `Retarget` and `SmoothRoot`.
inline constexpr Basis local_basis{{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 1};

struct LocalTensor {
  std::vector<std::int64_t> shape;
  std::vector<float> values;
};
using LocalTensors = std::map<std::string, LocalTensor>;

/// Runs the graph of a gender for all people of a call: all its inputs to all its outputs.
using LocalRun = std::function<LocalTensors(const std::string& gender, const LocalTensors& inputs)>;

/// The contents of `wayfarer.json` and `body_<gender>.bin`. It never changes, so any thread may use it.
class LocalModel {
 public:
  /// Reads a folder. Throws std::runtime_error that says what is missing or cut short.
  static LocalModel read(const std::string& folder);
  /// Reads the files' contents; `body` returns a file by its name.
  LocalModel(std::string_view sidecar, const std::function<std::string(const std::string& file)>& body);

  /// Names of the graph's inputs and outputs.
  const std::vector<std::string>& inputs() const;
  const std::vector<std::string>& outputs() const;

  struct Parts;
  const Parts& parts() const { return *parts_; }

 private:
  std::shared_ptr<const Parts> parts_;
};

/// A place to go to; without `stop` it is passed, with `strafe` the heading is held on the way.
struct LocalGoal {
  double x = 0, y = 0, radius = 0.3, speed = 1.2;
  std::optional<double> heading;
  bool stop = true, strafe = false;
  double dwell = 0;  // seconds to stand there before the next goal
};

/// A person; the motion follows from the seed, as on the server.
struct LocalSpec {
  std::string gender = "female";
  std::array<double, 10> betas{};
  double x = 0, y = 0, heading = 0;
  std::uint64_t seed = 0;
  bool foot_lock = true;
};

/// Eight frames of a person, 40 a second, as they are shown.
struct LocalChunk {
  enum Flag { FIRST = 1, REPLANNED = 2, ARRIVED = 4 };

  int person = 0, seq = 0;
  double time = 0;                                    // of its first frame
  std::array<std::array<float, 91>, 8> frames{};      // hips x, y, z, then x, y, z, w for each of 22 bones
  std::array<std::array<bool, 2>, 8> contacts{};      // left, right
  std::string_view state;                             // standing, walking, stopping, turning
  int flags = 0, waypoint = 0, goal_revision = 0;
  bool done = false;                                  // at the last goal of the path
};

/// People on a floor without end, who walk through each other. One thread at a time; reads no clock.
class LocalWorld {
 public:
  using Sent = std::function<void(const LocalChunk&)>;

  LocalWorld(LocalModel model, LocalRun run);
  LocalWorld(LocalWorld&&) noexcept;
  ~LocalWorld();

  /// Adds a person that stands there from about a chunk (0.2 s) after `now` on; returns its number. Throws
  /// std::invalid_argument for a gender that the model does not have.
  int add(const LocalSpec& spec, double now);
  void remove(int person);
  /// Goals in place of those given before; none: stop.
  void give(int person, const std::vector<LocalGoal>& goals, double now);
  void append(int person, const std::vector<LocalGoal>& goals, double now);
  /// `rest_offsets` for `Retarget`: the bones seen from their parents in the T-pose, three numbers each.
  std::vector<float> bones(int person) const;
  /// Makes what is due by `until`, and hands out each chunk when its first frame is due. Chunks are made one ahead.
  void advance(double until, const Sent& sent);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace wayfarer
