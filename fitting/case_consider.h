// What a case says of how well things are known that it does not fit: /fit/consider.
// Tests: tests/fitting/case_test.cpp
#pragma once

#include <vector>

#include "fitting/case.h"

namespace rhytid::fitting {

/// Fills `consider`, `consider_quantities` and `consider_paths` of c.fit from the case's JSON, after rules; leaves them
/// as they are where it says nothing. `scenes` are those of the fit. Throws InputError.
void read_considered(const LocatedJson& located, const std::vector<Scene>& scenes, Case& c);

}  // namespace rhytid::fitting
