// How the programs end, as seen by a shell.
#pragma once

namespace rhytid::tools {

enum class ExitCode {
  ok = 0,
  unexpected = 1,     ///< a bug or the system (out of memory, disk full); one line on stderr
  bad_input = 2,      ///< the command line, a scene, a mesh, a video; one line on stderr
  not_converged = 3,  ///< a numerical outcome or a failed check; partial results are kept
  interrupted = 4,    ///< SIGINT or SIGTERM; what was finished is kept (`simulate --resume` and `fit` go on)
};

}  // namespace rhytid::tools
