// What doctor finds on this machine for the simulator alone: BLAS, libraries, processor, threads.
#pragma once

#include <string>
#include <vector>

#include "tools/verb.h"

namespace rhytid::tools {

/// Compiled-in and loaded libraries, which one answers dgemm_ (bad unless OpenBLAS), processor and threads.
std::vector<EnvironmentFact> simulator_environment(int threads);

/// The same for the fitting part: Ceres, NLopt, OpenCV with its video backends, Embree.
/// Defined only in the program that carries them.
std::vector<EnvironmentFact> fitting_environment();

}  // namespace rhytid::tools
