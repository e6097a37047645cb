// What `bench recovery` makes worse than it is: more noise, fewer tracks, a model of the skin or the finger that is
// wrong in a known way. Tests: tests/tools/recovery_test.cpp
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/case.h"

namespace rhytid::tools {

/// A case as a variant has it.
struct VariedCase {
  fitting::Case c;
  int keep_every = 1;  ///< of so many tracks, in the order of their ids, one is kept
};

struct RecoveryVariant {
  std::string name;         ///< for files and --variants: "noise_x2"
  std::string description;  ///< a clause: what is other than in the case
};

/// All variants, the case as it is first.
const std::vector<RecoveryVariant>& recovery_variants();

/// The case changed so; nothing where that means nothing (no friction to hold, no time that is fitted). `fit`
/// and `truth` are the scenes of the case. Throws ContractError for a name that is none of recovery_variants.
std::optional<VariedCase> varied_case(const fitting::Case& c, const Scene& fit, const Scene& truth,
                                      const std::string& name);

}  // namespace rhytid::tools
