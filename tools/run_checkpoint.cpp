#include "tools/run_checkpoint.h"

#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/time/model_digest.h"

namespace rhytid::tools {
namespace {

constexpr const char* format_name = "rhytid run state 3";

std::string bytes(const double* values, std::size_t count) {
  return {reinterpret_cast<const char*>(values), count * sizeof(double)};
}

}  // namespace

std::string run_identity(const Scene& scene, const Model& model) {
  nlohmann::json json = scene_to_json(scene);
  for (const char* key : {"name", "description", "output"}) json.erase(key);
  json["time"].erase("frames");
  return nlohmann::json{{"scene", json}, {"content", content_digest(model)}}.dump();
}

void write_checkpoint(const std::string& path, const RunCheckpoint& c) {
  // A header line, then time, u, velocity, history and the carried numbers as raw doubles.
  const nlohmann::ordered_json header = {{"format", format_name},
                                         {"frame", c.frame},
                                         {"u", c.state.u.size()},
                                         {"velocity", c.state.velocity.size()},
                                         {"history", c.state.history.size()},
                                         {"carried", c.carried.size()},
                                         {"identity", c.identity}};
  write_file(path, header.dump() + "\n" + bytes(&c.state.time, 1) +
                       bytes(c.state.u.data(), c.state.u.size()) +
                       bytes(c.state.velocity.data(), c.state.velocity.size()) +
                       bytes(c.state.history.data(), c.state.history.size()) +
                       bytes(c.carried.data(), c.carried.size()));
}

std::optional<RunCheckpoint> read_checkpoint(const std::string& path, const std::string& identity) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  const std::string content = read_file(path);
  const std::size_t end = content.find('\n');
  const auto header = nlohmann::json::parse(content.substr(0, end), nullptr, false);
  RunCheckpoint c;
  std::size_t u = 0, velocity = 0, history = 0, carried = 0;
  try {
    if (header.at("format") != format_name) throw std::invalid_argument("format");
    c.frame = header.at("frame").get<int>();
    u = header.at("u").get<std::size_t>();
    velocity = header.at("velocity").get<std::size_t>();
    history = header.at("history").get<std::size_t>();
    carried = header.at("carried").get<std::size_t>();
    c.identity = header.at("identity").get<std::string>();
    const std::size_t limit = content.size();  // no product below can then wrap around
    if (u > limit || velocity > limit || history > limit || carried > limit ||
        content.size() - end - 1 != (1 + u + velocity + history + carried) * sizeof(double))
      throw std::invalid_argument("size");
  } catch (const std::exception&) {
    throw InputError(path, "a damaged file", "the state.bin that a run wrote");
  }
  if (c.identity != identity)
    throw InputError(path, "the state of a different scene",
                     "that of this one (output and number of frames may differ)");
  const char* from = content.data() + end + 1;
  const auto take = [&](double* to, std::size_t count) {
    if (count) std::memcpy(to, from, count * sizeof(double));
    from += count * sizeof(double);
  };
  take(&c.state.time, 1);
  c.state.u.resize(static_cast<Eigen::Index>(u));
  take(c.state.u.data(), u);
  c.state.velocity.resize(static_cast<Eigen::Index>(velocity));
  take(c.state.velocity.data(), velocity);
  c.state.history.resize(static_cast<Eigen::Index>(history));
  take(c.state.history.data(), history);
  c.carried.resize(carried);
  take(c.carried.data(), carried);
  return c;
}

}  // namespace rhytid::tools
