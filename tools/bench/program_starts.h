// How large the programs are and how long one takes to start.
#pragma once

#include <string>
#include <vector>

namespace rhytid::tools {

struct ProgramStart {
  std::string name;    ///< rhytid-forward, rhytid
  double bytes = 0;    ///< of the file
  int libraries = 0;   ///< shared objects that it loads
  double seconds = 0;  ///< median of `--version`, from starting the process to its end
};

/// Of the programs that stand beside this one, each started `starts` times in turn. Empty where the system
/// does not say where this program is.
std::vector<ProgramStart> measure_program_starts(int starts);

}  // namespace rhytid::tools
