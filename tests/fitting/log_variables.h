// Variables of a fit for tests of what follows from a Jacobian alone.
#pragma once

#include <string>
#include <vector>

#include "fitting/parametrisation.h"

namespace rhytid::fitting::testing {

/// One per name, positive, in logarithms, from 1 within 0.1..10, without a prior.
inline std::vector<FitVariable> log_variables(const std::vector<std::string>& names) {
  std::vector<FitVariable> list;
  for (const std::string& name : names)
    list.push_back({.address = "/" + name,
                    .name = name,
                    .unit = "",
                    .transform = ParameterTransform::log,
                    .initial = 1,
                    .lower = 0.1,
                    .upper = 10,
                    .prior_sigma = {}});
  return list;
}

}  // namespace rhytid::fitting::testing
