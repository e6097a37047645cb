// What is read off a converged step for the table of scalars: energies, contact forces, penetration,
// extremes.
#pragma once

#include <string>
#include <vector>

#include "sim/time/simulate.h"

namespace rhytid::tools {

/// How the energy of a term in the step's potential is to be understood.
enum class EnergyKind {
  stored,       ///< a function of the configuration: elastic skin, ligaments, contact
  incremental,  ///< includes what the step dissipates: Maxwell branch of skin, friction
};
EnergyKind energy_kind(const Term& term);

/// "base contact" -> "base_contact", "skin (elastic)" -> "skin_elastic": for column names.
std::string column_name(const std::string& term_name);

/// A body that the skin touches: the base or a collider.
struct ContactReading {
  Vec3 force = Vec3::Zero();   ///< on the body, by the skin, friction included, N
  Vec3 centre = Vec3::Zero();  ///< of the body at the end of the step, mm
  double penetration = 0;      ///< largest depth over the quadrature points, mm; 0 when not touching
};

struct StepReading {
  std::vector<double> energies;          ///< [terms] in the step's potential, mJ
  std::vector<ContactReading> contacts;  ///< per contact term, in the order of contact_names
  double smallest_jacobian = 1;          ///< min det F over the points of the skin
  double largest_displacement = 0;       ///< mm, over nodes
};

/// Bodies with a contact term: "base", then the colliders, as named in the scene.
std::vector<std::string> contact_names(const Model& model);

/// Reads a converged step.
StepReading read_step(const StepProblem& problem, const State& end);

}  // namespace rhytid::tools
