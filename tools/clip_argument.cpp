#include "tools/clip_argument.h"

#include <filesystem>

#include "sim/core/error.h"

namespace rhytid::tools {

void add_clip_option(CLI::App& app, std::string& clip) {
  app.add_option(
         "--clip", clip,
         "which clip of a case that has several: its name, or NAME/CAMERA where several cameras saw it; "
         "its files go to a folder of that name in the -o folder")
      ->option_text("NAME");
}

ChosenView chosen_view(const fitting::Case& c, const std::string& clip, const std::string& folder) {
  if (c.clips.empty() && clip.empty()) return {c, folder};
  const auto [index, view] = fitting::view_named(c, clip);
  ChosenView chosen{fitting::case_of_view(c, index, view), fitting::folder_of_view(c, index, view, folder)};
  std::error_code error;
  std::filesystem::create_directories(chosen.folder, error);
  if (error) throw InputError(chosen.folder, error.message(), "a folder that can be written");
  return chosen;
}

}  // namespace rhytid::tools
