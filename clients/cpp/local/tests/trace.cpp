// What people do by the commands in a file: trace EXPORT TRACE.json prints the file with the chunks of this program.

#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "onnx_graphs.hpp"

namespace {

using Json = nlohmann::json;

wayfarer::LocalSpec spec_of(const Json& given) {
  wayfarer::LocalSpec spec;
  spec.gender = given.at("gender");
  spec.betas = given.at("betas");
  spec.x = given.at("x");
  spec.y = given.at("y");
  spec.heading = given.at("heading");
  spec.seed = std::stoull(given.at("seed").get<std::string>());
  spec.foot_lock = given.at("footLock");
  return spec;
}

wayfarer::LocalGoal goal_of(const Json& given) {
  wayfarer::LocalGoal goal;
  goal.x = given.at("x");
  goal.y = given.at("y");
  goal.radius = given.value("radius", goal.radius);
  goal.speed = given.value("speed", goal.speed);
  if (given.contains("heading")) goal.heading = given["heading"].get<double>();
  goal.stop = given.value("stop", goal.stop);
  goal.strafe = given.value("strafe", goal.strafe);
  goal.dwell = given.value("dwell", goal.dwell);
  return goal;
}

Json told(const wayfarer::LocalChunk& chunk) {
  Json translation = Json::array(), rotations = Json::array(), contacts = Json::array();
  for (std::size_t t = 0; t < chunk.frames.size(); ++t) {
    for (std::size_t k = 0; k < chunk.frames[t].size(); ++k) (k < 3 ? translation : rotations).push_back(chunk.frames[t][k]);
    for (const bool contact : chunk.contacts[t]) contacts.push_back(int(contact));
  }
  return {{"seq", chunk.seq}, {"flags", chunk.flags}, {"state", chunk.state}, {"waypoint", chunk.waypoint},
          {"translation", translation}, {"rotations", rotations}, {"contacts", contacts}};
}

}  // namespace

int main(int, char** words) try {
  const auto model = wayfarer::LocalModel::read(words[1]);
  OnnxGraphs graphs(words[1], model.outputs());
  wayfarer::LocalWorld world(model, [&](const auto& gender, const auto& inputs) { return graphs.run(gender, inputs); });
  std::ifstream file(words[2]);
  Json trace = Json::parse(file);
  std::vector<int> people;
  std::map<int, std::size_t> numbers;
  for (const Json& person : trace.at("people")) {
    people.push_back(world.add(spec_of(person), 0));
    numbers[people.back()] = people.size() - 1;
  }
  Json chunks(people.size(), Json::array());
  const auto sent = [&](const wayfarer::LocalChunk& chunk) { chunks[numbers.at(chunk.person)].push_back(told(chunk)); };
  for (const Json& command : trace.at("commands")) {
    const double at = command.at("at");
    world.advance(at, sent);
    std::vector<wayfarer::LocalGoal> goals;
    for (const Json& goal : command.at("goals")) goals.push_back(goal_of(goal));
    world.give(people.at(command.at("who")), goals, at);
  }
  world.advance(trace.at("seconds"), sent);
  trace["chunks"] = std::move(chunks);
  std::cout << trace;
  return 0;
} catch (const std::exception& error) {
  std::cerr << "trace: " << error.what() << "\n";
  return 1;
}
