// What each feature of a scene costs, in numbers: work done so far and memory held.
//
// A feature that the scene does not have costs nothing: all of its numbers are zero. Tests prove it (and that
// they are not zero where the feature is), `check` prints them. Tests: tests/adjoint/feature_work_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene_model.h"

namespace rhytid {

struct FeatureWork {
  std::string feature;  ///< as in SceneModel::features
  bool present = false;
  /// Calls of its terms: steps prepared, energies without and with gradient, Hessians, histories updated,
  /// tangent and adjoint blocks.
  long prepared = 0, energies = 0, gradients = 0, hessians = 0, updates = 0, tangents = 0, adjoints = 0;
  long heat_maps = 0;          ///< solved
  long points = 0;             ///< quadrature points of its terms
  std::size_t history = 0;     ///< numbers that a state carries for it from step to step
  std::size_t shapes = 0;      ///< rigid bodies
  std::size_t neighbours = 0;  ///< entries of neighbour lists of its bodies
  /// Memory: arrays of its terms, their history and prepared data of one step, its bodies, heat maps.
  std::size_t bytes = 0;

  long evaluations() const { return energies + gradients + hessians; }
  /// Neither work nor memory.
  bool is_nothing() const;
};

/// All features that can have terms, in the order of SceneModel::features, present or not. Viscosity and
/// pre-stretch are properties of the skin's terms, and each is given the whole of the terms that have it.
std::vector<FeatureWork> feature_work(const SceneModel& scene_model);

}  // namespace rhytid
