// Which footage saved tracks and saved truth belong to: both name it by its digest, so that neither is taken
// for that of other footage of the same name. Tests: tests/tools/fitting_verbs.sh
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace rhytid::tools {

/// {"file": name without folder, "digest": of the contents}, for track.json and truth.json. Throws InputError
/// when the file cannot be read.
nlohmann::json footage_record(const std::string& path);

/// True when track.json beside `tracks` says that they were followed in an earlier version of `footage`.
/// False without such a record, or when they are of another file.
bool tracks_are_outdated(const std::string& tracks, const std::string& footage);

/// True when truth.json says that it is the truth of these contents (a file without a digest says nothing
/// against it). False when there is no truth.json, or no footage. `tracks` empty, or a file whose track.json
/// then decides for which footage the question is.
bool is_truth_of(const std::string& truth, const std::string& footage, const std::string& tracks);

}  // namespace rhytid::tools
