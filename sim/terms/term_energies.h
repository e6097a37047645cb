// What a term's kernels say about the energies of a converged step (sim/time/energy_account.h), and the names
// of the parts that a law stores energy in.
#pragma once

#include <array>

#include "sim/math/isa.h"

namespace rhytid {

/// Energies of a term over a step, mJ (sim/time/energy_account.h). Plain sums, the same for every
/// instruction set.
struct TermEnergies {
  double stored[3]{}, stored_before[3]{};  ///< by part, at the end of the step and at its start
  double force_work = 0;                   ///< ∂W/∂u at the end of the step times Δu
  double dissipated = 0;                   ///< physically
  double body_work = 0;                    ///< done by a moving body on the skin
  void add(const TermEnergies& e) {
    for (int k = 0; k < 3; ++k) {
      stored[k] += e.stored[k];
      stored_before[k] += e.stored_before[k];
    }
    force_work += e.force_work;
    dissipated += e.dissipated;
    body_work += e.body_work;
  }
};

inline namespace RHYTID_ISA {

/// Names of the parts that a law's stored energy is reported in: its own list, or its name alone.
template <class Law>
constexpr auto stored_names_of() {
  if constexpr (requires { Law::stored_names; }) {
    return Law::stored_names;
  } else {
    return std::array<const char*, 1>{Law::name};
  }
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
