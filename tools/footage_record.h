// What saved tracks and saved truth belong to: both name their footage by its digest, so that neither is
// taken for that of other footage, whatever its name; tracks name their camera and settings besides. Tests:
// tests/tools/footage_record_test.cpp, tests/tools/fitting_verbs.sh
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace rhytid::tools {

/// {"file": name without folder, "digest": of the contents}, for track.json and truth.json. `path` is a video
/// or stills as of fitting::FrameSource. Throws InputError when there is nothing readable.
nlohmann::json footage_record(const std::string& path);

/// The part of track.json from which outdated_tracks tells what the tracks of that folder were made of.
/// `settings` decide the tracks beside the footage, by names that a message can use; `of_case` are those that
/// the case asked for, null without a case. `by_hand` when the command line had a say: options, another
/// video.
nlohmann::json tracks_record(const nlohmann::json& footage, const nlohmann::json& settings,
                             const nlohmann::json& of_case, bool by_hand);
/// What track.json holds while the tracks beside it are replaced.
nlohmann::json unfinished_tracks_record();

struct OutdatedTracks {
  std::string why;       ///< "of other footage", "made with other model, max_tracks"
  bool by_hand = false;  ///< tracking again as the case says would lose what the command line asked for
};
/// Why the tracks of the file `tracks` are not those that a case asks for now, of this `footage` (left out of
/// the question when it is not there) and with these `settings`. Nothing when they are, or when no track.json
/// beside them tells: then they come from somewhere else.
std::optional<OutdatedTracks> outdated_tracks(const std::string& tracks, const std::string& footage,
                                              const nlohmann::json& settings);

/// True when truth.json says that it is the truth of these contents (a file without a digest says nothing
/// against it). False when there is no truth.json, or no footage. `tracks` empty, or a file whose track.json
/// then decides for which footage the question is.
bool is_truth_of(const std::string& truth, const std::string& footage, const std::string& tracks);

}  // namespace rhytid::tools
