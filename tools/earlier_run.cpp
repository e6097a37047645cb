#include "tools/earlier_run.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// stem + at least four digits + ending, as FrameWriter numbers.
bool is_numbered(const std::string& name, const std::string& stem, const std::string& ending) {
  const std::size_t around = stem.size() + ending.size();
  return name.size() >= around + 4 && name.starts_with(stem) && name.ends_with(ending) &&
         name.find_first_not_of("0123456789", stem.size()) == name.size() - ending.size();
}

void collect(const fs::path& folder, const std::string& stem, const std::string& ending,
             std::vector<fs::path>& found) {
  std::error_code error;
  if (fs::is_symlink(folder, error)) return;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (entry->symlink_status().type() == fs::file_type::regular &&
        is_numbered(entry->path().filename().string(), stem, ending))
      found.push_back(entry->path());
}

bool is_run_record(const fs::path& path) {
  if (!fs::is_regular_file(path)) return false;
  const auto record = nlohmann::json::parse(read_file(path.string()), nullptr, false);
  return record.is_object() && record.contains("exit") && record.contains("progress") &&
         record.contains("scene");
}

}  // namespace

std::vector<fs::path> files_of_earlier_run(const std::string& folder, const std::vector<std::string>& also) {
  const fs::path root = folder;
  std::vector<fs::path> found;
  collect(root / "frames", "frame_", ".vtu", found);
  collect(root / "surface", "frame_", ".vtp", found);
  collect(root / "pictures", "shaded_", ".png", found);
  collect(root / "pictures", "displacement_", ".png", found);
  std::vector<std::string> names = {"frames.pvd", "surface.pvd", "steps.csv", "state.bin"};
  names.insert(names.end(), also.begin(), also.end());
  for (const std::string& name : names)
    if (fs::symlink_status(root / name).type() == fs::file_type::regular) found.push_back(root / name);
  std::sort(found.begin(), found.end());
  if (!found.empty() && !is_run_record(root / "run.json"))
    throw InputError("--output", found.front().string() + " in a folder without the run.json of a run",
                     "an empty folder or that of an earlier run");
  return found;
}

}  // namespace rhytid::tools
