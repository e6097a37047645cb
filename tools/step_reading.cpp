#include "tools/step_reading.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <limits>

#include "sim/terms/contact_law.h"

namespace rhytid::tools {
namespace {

bool starts_with(const std::string& text, const std::string& prefix) {
  return text.rfind(prefix, 0) == 0;
}

/// The body that a contact or friction term belongs to; empty for other terms.
std::string body_of(const Term& term) {
  if (term.name() == "base contact") return "base";
  for (const std::string prefix : {"contact ", "friction "})
    if (starts_with(term.name(), prefix)) return term.name().substr(prefix.size());
  return {};
}

bool is_contact(const Term& term) {
  return term.name() == "base contact" || starts_with(term.name(), "contact ");
}

bool is_friction(const Term& term) {
  return starts_with(term.name(), "friction ");
}

double largest_penetration(const Term& term, const TermStepData& data, const VectorXd& u) {
  const bool is_ellipsoid = &term.kernels() == &ellipsoid_contact_kernels();
  const ImplicitShape& shape =
      is_ellipsoid ? *term.law<EllipsoidContactLaw>().shape : *term.law<ContactLaw>().shape;
  double deepest = 0;
  for (std::size_t gi = 0; gi < term.groups().size(); ++gi) {
    const TermGroup& g = term.groups()[gi];
    const double* theta = data.theta[gi].data();  // κ, inflation, centre: one row for the whole group
    const Vec3 centre(theta[2], theta[3], theta[4]);
    const Mat3 rotation =
        Eigen::Quaterniond(theta[5], theta[6], theta[7], theta[8]).normalized().toRotationMatrix();
    for (int e = 0; e < g.num_elements; ++e)
      for (int q = 0; q < g.num_points; ++q) {
        const double* rest = g.rest.data() + 4 * (static_cast<std::size_t>(e) * g.num_points + q);
        Vec3 x(rest[0], rest[1], rest[2]);
        for (int i = 0; i < g.num_nodes; ++i)
          x += g.node_by_row[static_cast<std::size_t>(q) * g.padded_nodes + i] *
               u.segment<3>(3 * g.nodes[static_cast<std::size_t>(e) * g.num_nodes + i]);
        const Vec3 place = rotation.transpose() * (x - centre);
        SizeDerivatives unused;
        const GapJet jet = is_ellipsoid
                               ? shape.evaluate_sized(place, Vec3(theta[9], theta[10], theta[11]), unused)
                               : shape.evaluate(place);
        if (jet.supported) deepest = std::max(deepest, theta[1] + rest[3] - jet.gap);
      }
  }
  return deepest;
}

}  // namespace

EnergyKind energy_kind(const Term& term) {
  return term.name() == "skin" || is_friction(term) ? EnergyKind::incremental : EnergyKind::stored;
}

std::string column_name(const std::string& term_name) {
  std::string name;
  for (const char c : term_name) {
    if (std::isalnum(static_cast<unsigned char>(c))) {
      name += c;
    } else if (c != ')' && !name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  return name;
}

std::vector<std::string> contact_names(const Model& model) {
  std::vector<std::string> names;
  for (const Term& term : model.terms)
    if (is_contact(term)) names.push_back(body_of(term));
  return names;
}

StepReading read_step(const StepProblem& problem, const State& end) {
  const Model& model = problem.model();
  StepReading reading;
  reading.energies = problem.term_energies(end.u);
  const std::vector<std::string> names = contact_names(model);
  reading.contacts.resize(names.size());
  reading.smallest_jacobian = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < model.terms.size(); ++k) {
    const Term& term = model.terms[k];
    reading.smallest_jacobian = std::min(reading.smallest_jacobian, term.smallest_jacobian(end.u));
    const std::string body = body_of(term);
    if (body.empty()) continue;
    ContactReading& contact = reading.contacts[std::find(names.begin(), names.end(), body) - names.begin()];
    // ∂W/∂u is minus the force on the skin, so its sum is the force on the body.
    VectorXd gradient = VectorXd::Zero(end.u.size());
    (void)term.energy(problem.step(), problem.data(k), end.u, &gradient, nullptr);
    contact.force +=
        Eigen::Map<const MatrixX3>(gradient.data(), model.num_nodes(), 3).colwise().sum().transpose();
    if (!is_contact(term)) continue;
    contact.penetration = largest_penetration(term, problem.data(k), end.u);
    const double* theta = problem.data(k).theta[0].data();  // κ, inflation, centre
    contact.centre = Vec3(theta[2], theta[3], theta[4]);
  }
  for (Eigen::Index i = 0; i < end.u.size(); i += 3)
    reading.largest_displacement = std::max(reading.largest_displacement, end.u.segment<3>(i).norm());
  return reading;
}

}  // namespace rhytid::tools
