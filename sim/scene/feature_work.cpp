#include "sim/scene/feature_work.h"

#include "sim/scene/parts/ligament_part.h"

namespace rhytid {

namespace {

void add_term(const Term& term, FeatureWork& work) {
  const TermCounters& done = term.counters();
  work.prepared += done.prepare;
  work.energies += done.energy;
  work.gradients += done.gradient;
  work.hessians += done.hessian;
  work.updates += done.update;
  work.tangents += done.tangent;
  work.adjoints += done.adjoint;
  work.points += term.num_points();
  work.history += term.history_size();
  const std::size_t prepared = static_cast<std::size_t>(term.num_points()) * term.kernels().np;
  work.bytes += term.bytes() + (term.history_size() + prepared) * sizeof(double);
}

}  // namespace

bool FeatureWork::is_nothing() const {
  return prepared + energies + gradients + hessians + updates + tangents + adjoints + heat_maps + points ==
             0 &&
         history + shapes + neighbours + bytes == 0;
}

std::vector<FeatureWork> feature_work(const SceneModel& scene_model) {
  const Model& model = scene_model.model();
  std::vector<FeatureWork> list;
  for (const FeatureNote& note : scene_model.features()) {
    if (note.present && note.terms.empty()) continue;  // a constraint
    FeatureWork work;
    work.feature = note.feature;
    work.present = note.present;
    for (const int t : note.terms) add_term(model.terms[static_cast<std::size_t>(t)], work);
    for (const int s : note.shapes) {
      const ImplicitShape& shape = *model.shapes[static_cast<std::size_t>(s)];
      ++work.shapes;
      work.neighbours += shape.num_neighbours();
      work.bytes += shape.bytes();
    }
    if (note.feature == "ligaments" && scene_model.ligaments()) {
      work.heat_maps = scene_model.ligaments()->heat_maps_solved();
      work.bytes += scene_model.ligaments()->bytes();
    }
    list.push_back(std::move(work));
  }
  return list;
}

}  // namespace rhytid
