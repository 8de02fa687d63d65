// One person walks to a goal without a server: ONNX Runtime's C API runs what
// `wayfarer export --for engines` has written, and this file decides what the person does.
//
//   offline FOLDER [--goal X,Y] [--gender female|male] [--pose N] [--heading RADIANS]
//                  [--speed M/S] [--radius M] [--seconds S]
//
// prints the hips of every frame as CSV: metres, radians, Z up, heading 0 faces +Y.
//
// `decide` and `inputs` are the rules of the folder's README.md, which are the server's for a goal to stop
// at. What the server adds to them is not here: feet that stand are kept in place while the body goes on
// moving (here the last frame is held), the trim of the speed, own strides, mirrored people, reaction times,
// repairs. tests/clients/test_cpp_offline.py says how far paths are from the server's.
#include <onnxruntime_c_api.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Floats = std::vector<float>;
using Json = nlohmann::json;

constexpr int SEED = 2, FRAMES = 8, JOINTS = 22;  // checked against the sidecar

struct Vector {
  double x = 0, y = 0;
};
Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y}; }
Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y}; }
Vector operator*(double s, Vector a) { return {s * a.x, s * a.y}; }
double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y; }
double length(Vector a) { return std::hypot(a.x, a.y); }
Vector unit(Vector a) { return (1 / std::max(length(a), 1e-6)) * a; }
double angle(Vector a, Vector b) { return std::acos(std::clamp(dot(a, b), -1.0, 1.0)); }

// What is in an exported folder ---------------------------------------------------------------------------

struct Model {
  Json about;
  std::string folder, gender;
  std::map<std::string, Floats> body;

  Model(std::string where, std::string which) : folder(std::move(where)), gender(std::move(which)) {
    std::ifstream file(folder + "/wayfarer.json");
    if (!file) throw std::runtime_error(folder + ": holds no wayfarer.json; see `wayfarer export --for engines`");
    about = Json::parse(file);
    if (about.at("schema") != 1 || about.at("seed_frames") != SEED || about.at("frames_per_step") != FRAMES ||
        about.at("joints").size() != JOINTS)
      throw std::runtime_error(folder + "/wayfarer.json: another schema than this program reads (1)");
    if (!about.at("bodies").contains(gender)) throw std::runtime_error(gender + ": no such body; female or male");
    const Json& layout = about["bodies"][gender];
    std::ifstream data(folder + "/" + layout.at("file").get<std::string>(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(data), {}};
    for (const Json& part : layout.at("parts")) {
      const std::size_t offset = part.at("offset"), size = part.at("bytes");
      if (offset + size > bytes.size()) throw std::runtime_error(layout["file"].get<std::string>() + ": is cut short");
      Floats& values = body[part.at("name")];
      values.resize(size / sizeof(float));
      std::copy_n(bytes.data() + offset, size, reinterpret_cast<char*>(values.data()));
    }
  }
  double steering(const char* name) const { return about.at("steering").at(name).at("value"); }
  std::size_t markers() const { return about.at("markers").size(); }
};

// ONNX Runtime ----------------------------------------------------------------------------------------------

const OrtApi* api = nullptr;

void check(OrtStatus* status) {
  if (!status) return;
  const std::string message = api->GetErrorMessage(status);
  api->ReleaseStatus(status);
  throw std::runtime_error("onnxruntime: " + message);
}

using Tensors = std::map<std::string, Floats>;

class Graph {
 public:
  Graph(const std::string& path, const Json& inputs, const Json& outputs) : inputs_(inputs), outputs_(outputs) {
    const OrtApiBase* base = OrtGetApiBase();
    // the headers' version, or the newest that the library knows: both know what is used here
    for (unsigned version = ORT_API_VERSION; !api && version >= 11; --version) api = base->GetApi(version);
    if (!api) throw std::runtime_error("ONNX Runtime 1.11 or newer is needed");
    check(api->CreateEnv(ORT_LOGGING_LEVEL_WARNING, "wayfarer", &environment_));
    check(api->CreateSessionOptions(&options_));
    check(api->SetIntraOpNumThreads(options_, 1));
    check(api->CreateSession(environment_, path.c_str(), options_, &session_));
    check(api->CreateCpuMemoryInfo(OrtArenaAllocator, OrtMemTypeDefault, &memory_));
  }
  Graph(const Graph&) = delete;
  ~Graph() {
    api->ReleaseMemoryInfo(memory_);
    api->ReleaseSession(session_);
    api->ReleaseSessionOptions(options_);
    api->ReleaseEnv(environment_);
  }

  Tensors run(Tensors given) const {
    std::vector<std::string> names;
    std::vector<OrtValue*> values, found(outputs_.size(), nullptr);
    for (const Json& input : inputs_) {
      const std::string name = input.at("name");
      std::vector<int64_t> shape;
      std::size_t count = 1;
      for (const Json& size : input.at("shape")) {
        shape.push_back(size.is_string() ? 1 : size.get<int64_t>());  // "agents": one person
        count *= static_cast<std::size_t>(shape.back());
      }
      Floats& numbers = given[name];
      if (numbers.size() != count) throw std::runtime_error("input " + name + " has another size than the graph's");
      OrtValue* value = nullptr;
      check(api->CreateTensorWithDataAsOrtValue(memory_, numbers.data(), count * sizeof(float), shape.data(),
                                                shape.size(), ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &value));
      names.push_back(name);
      values.push_back(value);
    }
    std::vector<std::string> wanted;
    for (const Json& output : outputs_) wanted.push_back(output.at("name"));
    std::vector<const char*> in, out;
    for (const auto& name : names) in.push_back(name.c_str());
    for (const auto& name : wanted) out.push_back(name.c_str());
    OrtStatus* status =
        api->Run(session_, nullptr, in.data(), values.data(), in.size(), out.data(), out.size(), found.data());
    for (OrtValue* value : values) api->ReleaseValue(value);
    check(status);
    Tensors results;
    for (std::size_t i = 0; i < found.size(); ++i) {
      OrtTensorTypeAndShapeInfo* info = nullptr;
      std::size_t count = 0;
      void* data = nullptr;
      check(api->GetTensorTypeAndShape(found[i], &info));
      check(api->GetTensorShapeElementCount(info, &count));
      api->ReleaseTensorTypeAndShapeInfo(info);
      check(api->GetTensorMutableData(found[i], &data));
      const auto* first = static_cast<const float*>(data);
      results[wanted[i]].assign(first, first + count);
      api->ReleaseValue(found[i]);
    }
    return results;
  }

 private:
  Json inputs_, outputs_;
  OrtEnv* environment_ = nullptr;
  OrtSessionOptions* options_ = nullptr;
  OrtSession* session_ = nullptr;
  OrtMemoryInfo* memory_ = nullptr;
};

// A person --------------------------------------------------------------------------------------------------

enum Mode { STANDING, WALKING, STOPPING, TURNING };
const char* const MODES[] = {"STANDING", "WALKING", "STOPPING", "TURNING"};

struct Goal {
  Vector place;
  double radius = 0.3, speed = 1.2;
};

struct Person {
  Floats markers, translation, rotations, betas = Floats(10);  // the seed: the last two frames
  Mode mode = STANDING;
  bool arrived = false;
  double speed = 0, slow_for = 0;
  Vector stop_place, stop_facing;

  Vector hips(int frame = SEED - 1) const { return {translation[3 * frame], translation[3 * frame + 1]}; }
  Vector facing() const {
    const float* q = &rotations[(SEED - 1) * JOINTS * 4];
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    return unit({-2 * (x * y + z * w), 1 - 2 * (y * y + z * z)});
  }
};

// In one of the start poses, over the origin.
Person standing(const Model& model, std::size_t pose, double heading) {
  const Floats &markers = model.body.at("start_markers"), &turns = model.body.at("start_rotations");
  const std::size_t count = model.markers();
  if (pose >= turns.size() / (JOINTS * 4))
    throw std::runtime_error("there are " + std::to_string(turns.size() / (JOINTS * 4)) + " start poses, from 0");
  Person person;
  const double cosine = std::cos(heading), sine = std::sin(heading);
  Floats frame(3 * count);
  for (std::size_t i = 0; i < count; ++i) {  // betas are 0: nothing of start_markers_dirs
    const float* place = &markers[(pose * count + i) * 3];
    frame[3 * i] = static_cast<float>(cosine * place[0] - sine * place[1]);
    frame[3 * i + 1] = static_cast<float>(sine * place[0] + cosine * place[1]);
    frame[3 * i + 2] = place[2];
  }
  float lowest = 1e9F;
  for (const Json& foot : model.about.at("sole_markers"))
    for (const Json& marker : foot) lowest = std::min(lowest, frame[3 * marker.get<std::size_t>() + 2]);
  for (std::size_t i = 0; i < count; ++i) frame[3 * i + 2] -= lowest;
  Floats pose_turns(&turns[pose * JOINTS * 4], &turns[pose * JOINTS * 4] + JOINTS * 4);
  const double s = std::sin(heading / 2), c = std::cos(heading / 2);
  const double x = pose_turns[0], y = pose_turns[1], z = pose_turns[2], w = pose_turns[3];
  const double turned[] = {c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z};
  std::copy(turned, turned + 4, pose_turns.begin());
  for (int twice = 0; twice < SEED; ++twice) {
    person.markers.insert(person.markers.end(), frame.begin(), frame.end());
    person.translation.insert(person.translation.end(), {0, 0, -lowest});
    person.rotations.insert(person.rotations.end(), pose_turns.begin(), pose_turns.end());
  }
  person.stop_facing = person.facing();
  return person;
}

// What the person does in the next 0.2 s: README.md, "before each step".
void decide(const Model& model, Person& person, const Goal& goal) {
  const auto constant = [&](const char* name) { return model.steering(name); };
  const Vector hips = person.hips(), way = goal.place - hips, direction = unit(way);
  const double distance = length(way);
  const double braking = std::min(goal.radius / 2, constant("braking_margin")) + constant("braking_seconds") * person.speed;
  const bool walking = person.mode == WALKING, turning = person.mode == TURNING, stood = person.mode == STANDING;
  const bool slow_now = person.speed < constant("slow");
  const bool counts = stood || (person.mode == STOPPING && slow_now);
  person.slow_for = counts ? person.slow_for + model.about.at("step_seconds").get<double>() : 0;
  const bool still = person.mode == STOPPING && person.slow_for >= constant("slow_seconds") - 1e-3;
  const bool rests = still || stood || turning || (walking && slow_now);
  const bool paused = walking && person.speed < constant("pausing") * std::min(goal.speed, constant("slowest"));
  const bool far = distance > braking && !(person.arrived && (slow_now || paused));
  const bool reverses = !person.arrived && far &&
                        angle(person.facing(), direction) > constant(turning ? "abeam" : "behind");
  const bool about = reverses && (rests || slow_now);
  const bool strayed = distance > std::max(goal.radius, braking) + constant("resume_margin");
  const bool walks = !reverses && ((walking && far) || ((still || stood || turning) && !person.arrived) ||
                                   (!walking && strayed));
  if ((still && !walks) || (about && !turning)) {
    person.stop_place = hips;
  } else if (walking && !walks) {
    const Vector motion = unit(hips - person.hips(0));
    person.stop_place = reverses ? hips + constant("coasting_seconds") * person.speed * motion : goal.place;
  }
  if (about) {
    person.stop_facing = direction;
  } else if (!walks && (walking || still)) {
    person.stop_facing = person.facing();
  }
  person.mode = walks ? WALKING : about ? TURNING : (stood || still) ? STANDING : STOPPING;
}

// The graph's inputs for that: README.md, "inputs".
Tensors inputs(const Model& model, const Person& person, const Goal& goal) {
  const bool walking = person.mode == WALKING;
  const Vector place = walking ? goal.place : person.stop_place;
  double speed = 0;
  Vector facing = person.stop_facing;
  if (walking) {
    const double step = model.about.at("step_seconds"), distance = length(goal.place - person.hips());
    const double slowing = goal.speed * distance / model.steering("slowing_distance");
    speed = std::min({goal.speed, person.speed + model.steering("acceleration") * step,
                      std::max(slowing, model.steering("slowest"))});
    facing = {};
  } else if (person.mode == TURNING) {
    const Vector now = person.facing();
    const double most = model.steering("turn_ahead");
    const double turn = std::clamp(std::atan2(now.x * facing.y - now.y * facing.x, dot(now, facing)), -most, most);
    facing = {std::cos(turn) * now.x - std::sin(turn) * now.y, std::sin(turn) * now.x + std::cos(turn) * now.y};
  }
  const auto f = [](double value) { return static_cast<float>(value); };
  const Json& mode = model.about.at("modes").at(MODES[person.mode]);
  Tensors given;
  given["seed_markers"] = person.markers;
  given["seed_translation"] = person.translation;
  given["seed_rotations"] = person.rotations;
  given["betas"] = person.betas;
  given["goal"] = {f(place.x), f(place.y), 0};
  given["target_speed"] = {f(speed)};
  given["facing"] = {f(facing.x), f(facing.y)};
  given["term_weights"] = mode.at("term_weights").get<Floats>();
  given["policy"] = {mode.at("policy").get<float>()};
  given["noise"] = Floats(128);  // the policy's mean
  return given;
}

// The seed of the next step, and what the step brought: README.md, "after the step".
void take(Person& person, const Goal& goal, const Tensors& out) {
  const Floats &translation = out.at("translation"), &rotations = out.at("rotations");
  const Vector before = person.hips();
  for (int frame = 0; frame < FRAMES; ++frame)
    person.arrived |= length(Vector{translation[3 * frame], translation[3 * frame + 1]} - goal.place) <= goal.radius;
  person.markers = out.at("next_seed_markers");
  person.translation.assign(translation.end() - SEED * 3, translation.end());
  person.rotations.assign(rotations.end() - SEED * JOINTS * 4, rotations.end());
  person.speed = length(person.hips() - before) / (FRAMES / 40.0);
}

struct Options {
  std::string folder, gender = "female";
  Goal goal{{0, 4}};
  int pose = 0;
  double heading = 0, seconds = 8;
};

Options read(int count, char** words) {
  const std::string usage =
      "usage: offline FOLDER [--goal X,Y] [--gender female|male] [--pose N] [--heading RADIANS] [--speed M/S] "
      "[--radius M] [--seconds S]";
  if (count < 2 || count % 2 != 0) throw std::runtime_error(usage);
  Options options;
  options.folder = words[1];
  for (int at = 2; at + 1 < count; at += 2) {
    const std::string name = words[at], value = words[at + 1];
    const std::size_t comma = value.find(',');
    try {
      if (name == "--gender") options.gender = value;
      else if (name == "--goal") options.goal.place = {std::stod(value), std::stod(value.substr(comma + 1))};
      else if (name == "--pose") options.pose = std::stoi(value);
      else if (name == "--heading") options.heading = std::stod(value);
      else if (name == "--speed") options.goal.speed = std::stod(value);
      else if (name == "--radius") options.goal.radius = std::stod(value);
      else if (name == "--seconds") options.seconds = std::stod(value);
      else throw std::runtime_error(name + ": no such option\n" + usage);
    } catch (const std::logic_error&) {  // of stod and stoi
      throw std::runtime_error(name + " " + value + ": no number");
    }
    if (name == "--goal" && comma == std::string::npos) throw std::runtime_error("--goal " + value + ": not X,Y");
  }
  return options;
}

}  // namespace

int main(int count, char** words) try {
  const Options options = read(count, words);
  const Model model(options.folder, options.gender);
  const Graph graph(options.folder + "/step_" + options.gender + ".onnx", model.about.at("inputs"),
                    model.about.at("outputs"));
  Person person = standing(model, static_cast<std::size_t>(options.pose), options.heading);
  person.mode = WALKING;  // a new goal
  std::puts("seconds,mode,arrived,x,y,z,heading,left,right");
  const int steps = static_cast<int>(std::ceil(options.seconds * 40 / FRAMES));
  for (int step = 0; step < steps; ++step) {
    decide(model, person, options.goal);
    const bool holds = person.mode == STANDING && person.arrived;  // nothing to do: see README.md
    Tensors out;
    if (holds) {
      person.speed = 0;
    } else {
      out = graph.run(inputs(model, person, options.goal));
      take(person, options.goal, out);
    }
    for (int frame = 0; frame < FRAMES; ++frame) {  // here a host would pose its character
      const float* place = holds ? &person.translation[3] : &out.at("translation")[3 * frame];
      const float* q = holds ? &person.rotations[JOINTS * 4] : &out.at("rotations")[frame * JOINTS * 4];
      const float still[] = {1, 1}, *feet = holds ? still : &out.at("contacts")[2 * frame];
      const double heading = std::atan2(2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[1] * q[1] + q[2] * q[2]));
      std::printf("%.3f,%s,%d,%.6f,%.6f,%.6f,%.6f,%.0f,%.0f\n", (step * FRAMES + frame) / 40.0, MODES[person.mode],
                  person.arrived, place[0], place[1], place[2], heading, feet[0], feet[1]);
    }
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "offline: %s\n", error.what());
  return 1;
}
