// One person walks to a goal without a server. ONNX Runtime's C API runs the files of `wayfarer export --for engines`,
// and wayfarer::local decides what the person does, as the server does.
//
//   offline FOLDER [--goal X,Y] [--gender female|male] [--seed N] [--heading RADIANS]
//                  [--speed M/S] [--radius M] [--seconds S]
//
// prints the hips of every frame as CSV: metres, radians, Z up, heading 0 faces +Y.

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "onnx_graphs.hpp"

namespace {

struct Options {
  std::string folder;
  wayfarer::LocalSpec person;
  wayfarer::LocalGoal goal;
  double seconds = 8;
};

Options read(int count, char** words) {
  const std::string usage =
      "usage: offline FOLDER [--goal X,Y] [--gender female|male] [--seed N] [--heading RADIANS] [--speed M/S] "
      "[--radius M] [--seconds S]";
  if (count < 2 || count % 2 != 0) throw std::runtime_error(usage);
  Options options;
  options.folder = words[1];
  options.goal.y = 4;
  for (int at = 2; at + 1 < count; at += 2) {
    const std::string name = words[at], value = words[at + 1];
    const std::size_t comma = value.find(',');
    if (name == "--goal" && comma == std::string::npos) throw std::runtime_error("--goal " + value + ": not X,Y");
    try {
      if (name == "--gender") options.person.gender = value;
      else if (name == "--goal") options.goal.x = std::stod(value), options.goal.y = std::stod(value.substr(comma + 1));
      else if (name == "--seed") options.person.seed = std::stoull(value);
      else if (name == "--heading") options.person.heading = std::stod(value);
      else if (name == "--speed") options.goal.speed = std::stod(value);
      else if (name == "--radius") options.goal.radius = std::stod(value);
      else if (name == "--seconds") options.seconds = std::stod(value);
      else throw std::runtime_error(name + ": no such option\n" + usage);
    } catch (const std::logic_error&) {  // of stod and stoull
      throw std::runtime_error(name + " " + value + ": no number");
    }
  }
  return options;
}

}  // namespace

int main(int count, char** words) try {
  const Options options = read(count, words);
  const auto model = wayfarer::LocalModel::read(options.folder);
  OnnxGraphs graphs(options.folder, model.outputs());
  wayfarer::LocalWorld world(model, [&](const auto& gender, const auto& inputs) { return graphs.run(gender, inputs); });
  const int person = world.add(options.person, 0);
  world.give(person, {options.goal}, 0);

  std::puts("seconds,state,done,x,y,z,heading,left,right");
  world.advance(options.seconds, [](const wayfarer::LocalChunk& chunk) {
    for (std::size_t t = 0; t < chunk.frames.size(); ++t) {  // a host would pose its character here
      const auto& frame = chunk.frames[t];
      const auto [left, right] = chunk.contacts[t];
      const double heading = wayfarer::local_basis.heading({frame[3], frame[4], frame[5], frame[6]});
      std::printf("%.3f,%s,%d,%.6f,%.6f,%.6f,%.6f,%d,%d\n", chunk.time + double(t) / 40, chunk.state.data(), chunk.done,
                  double(frame[0]), double(frame[1]), double(frame[2]), heading, left, right);
    }
  });
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "offline: %s\n", error.what());
  return 1;
}
