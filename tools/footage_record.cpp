#include "tools/footage_record.h"

#include <filesystem>
#include <optional>

#include "sim/core/digest.h"
#include "sim/output/atomic_file.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// The record in a JSON file; nothing without one. A file that is no JSON is its reader's to complain about.
std::optional<nlohmann::json> record_in(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return std::nullopt;
  const nlohmann::json json = nlohmann::json::parse(read_file(path), nullptr, false);
  if (!json.is_object() || !json.contains("footage")) return std::nullopt;
  const nlohmann::json& footage = json["footage"];
  const auto has = [&footage](const char* key) { return footage.contains(key) && footage[key].is_string(); };
  if (!footage.is_object() || !has("file") || !has("digest")) return std::nullopt;
  return footage;
}

std::string beside(const std::string& tracks) {
  return (fs::path(tracks).parent_path() / "track.json").string();
}

}  // namespace

nlohmann::json footage_record(const std::string& path) {
  return {{"file", fs::path(path).filename().string()}, {"digest", file_digest(path)}};
}

bool tracks_are_outdated(const std::string& tracks, const std::string& footage) {
  const auto record = record_in(beside(tracks));
  std::error_code ignored;
  if (!record || !fs::is_regular_file(footage, ignored)) return false;
  return (*record)["file"] == fs::path(footage).filename().string() &&
         (*record)["digest"] != file_digest(footage);
}

bool is_truth_of(const std::string& truth, const std::string& footage, const std::string& tracks) {
  std::error_code ignored;
  if (!fs::is_regular_file(truth, ignored)) return false;
  const auto known = record_in(truth);
  if (!known) return true;
  if (!tracks.empty())
    if (const auto record = record_in(beside(tracks))) return (*record)["digest"] == (*known)["digest"];
  return fs::is_regular_file(footage, ignored) && (*known)["digest"] == file_digest(footage);
}

}  // namespace rhytid::tools
