// What an earlier `simulate` left in the folder of a new one.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace rhytid::tools {

/// Files of the names that `simulate` gives: frames/frame_0007.vtu, surface/frame_0007.vtp, pictures/
/// shaded_0007.png and displacement_0007.png, frames.pvd, surface.pvd, steps.csv, state.bin; and those in
/// `also`, which someone else wrote beside them. Nothing else, whatever lies there, no links and no folders.
/// Sorted.
///
/// A new run removes them, so that no frame of a longer or finer earlier run stays behind its own. Throws
/// InputError when there are such files in a folder without the run.json of a run: they are not known to be
/// ours.
std::vector<std::filesystem::path> files_of_earlier_run(const std::string& folder,
                                                        const std::vector<std::string>& also = {});

}  // namespace rhytid::tools
