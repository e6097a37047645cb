#include "tools/footage_record.h"

#include <filesystem>
#include <optional>

#include "fitting/tracking/frame_source.h"
#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// An object in a JSON file; nothing without one. A file that is no JSON is its reader's to complain about.
std::optional<nlohmann::json> object_in(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return std::nullopt;
  nlohmann::json json = nlohmann::json::parse(read_file(path), nullptr, false);
  if (!json.is_object()) return std::nullopt;
  return json;
}

/// The digest of the footage that a record names; nothing without one.
std::optional<std::string> footage_digest_in(const std::optional<nlohmann::json>& record) {
  if (!record || !record->contains("footage") || !(*record)["footage"].is_object()) return std::nullopt;
  const auto digest = (*record)["footage"].find("digest");
  if (digest == (*record)["footage"].end() || !digest->is_string()) return std::nullopt;
  return digest->get<std::string>();
}

std::optional<std::string> digest_if_there(const std::string& footage) {
  try {
    return footage_record(footage)["digest"].get<std::string>();
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::string beside(const std::string& tracks) {
  return (fs::path(tracks).parent_path() / "track.json").string();
}

/// "model, max_tracks": what differs between two objects. What an earlier program did not know of is null.
std::string differing(const nlohmann::json& a, const nlohmann::json& b) {
  std::string names;
  for (const auto& [name, value] : b.items())
    if (a.value(name, nlohmann::json()) != value) names += (names.empty() ? "" : ", ") + name;
  return names;
}

}  // namespace

nlohmann::json footage_record(const std::string& path) {
  std::error_code ignored;
  std::string digest;
  if (fs::is_regular_file(path, ignored)) {
    digest = file_digest(path);
  } else {
    fitting::FrameSourceOptions stills;
    stills.path = path;
    Digest all;
    for (const std::string& file : fitting::FrameSource(stills).files()) all.text(file_digest(file));
    digest = all.hex();
  }
  return {{"file", fs::path(path).filename().string()}, {"digest", digest}};
}

nlohmann::json tracks_record(const nlohmann::json& footage, const nlohmann::json& settings,
                             const nlohmann::json& of_case, bool by_hand) {
  return {{"footage", footage}, {"settings", settings}, {"case_settings", of_case}, {"by_hand", by_hand}};
}

nlohmann::json unfinished_tracks_record() {
  return {{"unfinished", true}};
}

std::optional<OutdatedTracks> outdated_tracks(const std::string& tracks, const std::string& footage,
                                              const nlohmann::json& settings) {
  const auto record = object_in(beside(tracks));
  if (!record) return std::nullopt;
  if (record->contains("unfinished")) return OutdatedTracks{"not finished"};
  OutdatedTracks found;
  found.by_hand = record->value("by_hand", nlohmann::json(false)) == true;
  const auto recorded = footage_digest_in(record), present = digest_if_there(footage);
  if (recorded && present && *recorded != *present) found.why = "of other footage";
  const auto asked = record->find("case_settings");
  const std::string names =
      asked != record->end() && asked->is_object() ? differing(*asked, settings) : std::string();
  if (!names.empty()) found.why += (found.why.empty() ? "made with other " : " and made with other ") + names;
  if (found.why.empty()) return std::nullopt;
  return found;
}

bool is_truth_of(const std::string& truth, const std::string& footage, const std::string& tracks) {
  std::error_code ignored;
  if (!fs::is_regular_file(truth, ignored)) return false;
  const auto known = footage_digest_in(object_in(truth));
  if (!known) return true;
  if (!tracks.empty())
    if (const auto recorded = footage_digest_in(object_in(beside(tracks)))) return *recorded == *known;
  return digest_if_there(footage) == known;
}

}  // namespace rhytid::tools
