// Writes the files that abi.c reads: abi_files FOLDER

#include <filesystem>
#include <fstream>

#include "crowd.hpp"

int main(int, char** values) {
  const std::filesystem::path folder = values[1];
  std::filesystem::create_directories(folder);
  const auto write = [&](const char* name, const golden::Bytes& bytes) {
    std::ofstream(folder / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  };
  write("header", crowd::header());
  write("batch", crowd::batch(golden::walk("gltf"), 1, 0));
  write("event", golden::message("event"));
  std::ofstream rig(folder / "rig.txt");
  const golden::Case own = golden::cases()[0];
  for (const auto& [name, parent, p, q, s] : own.rig.nodes())
    rig << name << ' ' << parent << ' ' << p.x << ' ' << p.y << ' ' << p.z << ' ' << q.x << ' ' << q.y << ' ' << q.z
        << ' ' << q.w << ' ' << s.x << ' ' << s.y << ' ' << s.z << '\n';
}
