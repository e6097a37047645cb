// The scalars of a step against independent facts: balance of forces, energy against work, continued tables.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"
#include "tools/run_checkpoint.h"
#include "tools/step_table.h"

namespace rhytid::tools {
namespace {

/// A frictionless ball presses an elastic patch that nothing else holds but its rim.
std::string pressed_patch(int substeps) {
  return R"({"name": "pressed",
    "skin": {"surface": {"grid": {"size": [12, 12], "cells": [3, 3]}}, "order": 2,
             "layers": [{"name": "a", "thickness": 1.5, "youngs_modulus": 0.05, "relaxing_fraction": 0}]},
    "colliders": [{"name": "ball", "radius": 5, "stiffness": 0.5, "onset": 0.02,
                   "path": [{"time": 0, "position": [0, 0, 5]}, {"time": 1, "position": [0, 0, 4.2]}]}],
    "time": {"frame_rate": 4, "frames": 4, "substeps": )" +
         std::to_string(substeps) + "}}";
}

struct Column {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
  double last(const std::string& name) const {
    const auto at = std::find(names.begin(), names.end(), name) - names.begin();
    if (at == static_cast<std::ptrdiff_t>(names.size())) throw std::out_of_range("no column " + name);
    return rows.back()[at];
  }
};

TEST(StepTable, DocumentationNamesEveryColumn) {
  // | `name` | unit | meaning |, with NAME for what the scene names.
  std::vector<std::regex> known;
  const std::string documentation = step_table_documentation();
  const std::regex row(R"(\n\| `([A-Za-z_]+)`[^|]*\| ([^|]*) ?\|)");
  for (std::sregex_iterator it(documentation.begin(), documentation.end(), row), end; it != end; ++it) {
    std::string pattern = std::regex_replace((*it)[1].str(), std::regex("NAME"), "[a-z_]+");
    pattern = std::regex_replace(pattern, std::regex("_x$"), "_[xyz]");
    const std::string unit =
        std::regex_replace(std::regex_replace((*it)[2].str(), std::regex("/"), "_per_"), std::regex(" "), "");
    known.emplace_back(unit.empty() ? pattern : pattern + "_" + unit);
  }
  const SceneModel model(parse_scene_text(test::drag_scene(2, 1), "drag.json"));
  const std::string text = StepTable(model.model()).table().text();
  std::istringstream header(text.substr(0, text.find('\n')));
  int columns = 0;
  for (std::string name; std::getline(header, name, ','); ++columns)
    EXPECT_TRUE(std::any_of(known.begin(), known.end(), [&](const std::regex& r) {
      return std::regex_match(name, r);
    })) << name;
  EXPECT_GT(columns, 30);
}

Column parse(const std::string& csv) {
  Column result;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    std::vector<std::string> row;
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
    if (result.names.empty()) {
      result.names = row;
      continue;
    }
    result.rows.emplace_back();
    for (const std::string& cell : row) result.rows.back().push_back(std::stod(cell));
  }
  return result;
}

std::string run(const SceneModel& scene_model, StepReading* last = nullptr, VectorXd* reactions = nullptr) {
  StepTable table(scene_model.model());
  RunObserver observer;
  observer.step = [&](const StepEvent& e) {
    table.add(e);
    if (last) *last = read_step(e.problem, e.state);
    if (reactions) *reactions = e.problem.residual(e.state.u);
  };
  RunOptions options = scene_model.run_options();
  options.keep_states = false;
  EXPECT_TRUE(simulate(scene_model.model(), scene_model.native(), options, observer).complete);
  return table.table().text();
}

TEST(StepReading, contact_force_balances_the_reactions_of_the_rim) {
  const SceneModel scene_model(parse_scene_text(pressed_patch(1), "pressed.json"));
  StepReading last;
  VectorXd reactions;
  run(scene_model, &last, &reactions);
  // The residual at fixed nodes is the reaction; over all nodes it sums to ∂W/∂(rigid motion) = the
  // contact's.
  Vec3 sum = Vec3::Zero();
  for (Eigen::Index i = 0; i < reactions.size(); i += 3) sum += reactions.segment<3>(i);
  EXPECT_GT(last.contacts[0].force[2], 1e-3);
  EXPECT_NEAR((sum - last.contacts[0].force).norm(), 0, 1e-10);
  EXPECT_NEAR(last.contacts[0].force.head<2>().norm(), 0, 1e-10);
  // A penalty of 0.5 MPa/mm lets the ball in by less than the force over its contact, and by more than zero.
  EXPECT_GT(last.contacts[0].penetration, 0);
  EXPECT_LT(last.contacts[0].penetration, 0.2);
  EXPECT_EQ(last.contacts[0].centre, Vec3(0, 0, 4.2));
}

TEST(StepTable, work_of_an_elastic_press_is_stored) {
  double previous = 0;
  for (const int substeps : {2, 4, 8}) {
    const Column t = parse(run(SceneModel(parse_scene_text(pressed_patch(substeps), "pressed.json"))));
    EXPECT_GT(t.last("collider_work_mJ"), 0);
    EXPECT_LT(std::abs(t.last("energy_imbalance_mJ")), 1e-8 * t.last("collider_work_mJ"));
    EXPECT_EQ(t.last("dissipated_energy_mJ"), 0);
    // An elastic press loses nothing but what the implicit rule takes. That is of second order; the onset of
    // contact costs some of it.
    const double error = std::abs(t.last("numerical_dissipation_mJ")) / t.last("collider_work_mJ");
    EXPECT_LT(error, 0.05);
    EXPECT_NEAR(t.last("collider_work_mJ") - t.last("numerical_dissipation_mJ"), t.last("stored_energy_mJ"),
                1e-7 * t.last("collider_work_mJ"));
    if (previous > 0) {
      EXPECT_LT(error, 0.45 * previous);
    }
    previous = error;
    // An elastic scene stores its potential.
    EXPECT_NEAR(t.last("stored_energy_mJ"),
                t.last("skin_elastic_energy_mJ") + t.last("contact_ball_energy_mJ"),
                1e-12 * t.last("stored_energy_mJ"));
    EXPECT_NEAR(t.last("stored_skin_elastic_fung_mJ") + t.last("stored_skin_elastic_volumetric_mJ"),
                t.last("skin_elastic_energy_mJ"), 1e-12 * t.last("stored_energy_mJ"));
  }
}

TEST(StepTable, a_step_that_needed_softened_contacts_says_so) {
  const SceneModel m(parse_scene_text(pressed_patch(1), "pressed",
                                      {"/colliders/ball/stiffness=1000", "/colliders/ball/onset=0.0001"}));
  RunOptions options = m.run_options();
  options.max_bisections = 0;
  options.minimiser.max_iterations = 2000;
  std::vector<double> softened[2];
  int needed = 0;
  for (const bool starved : {false, true}) {
    if (starved) options.minimiser.max_iterations = needed - 1;
    StepTable table(m.model());
    RunObserver observer;
    observer.step = [&](const StepEvent& e) {
      table.add(e);
      needed = std::max(needed, starved ? 0 : e.record.report.iterations);
    };
    const Trajectory run = simulate(m.model(), m.native(), options, observer);
    ASSERT_TRUE(run.complete) << run.failure;
    const Column c = parse(table.table().text());
    const auto at = std::find(c.names.begin(), c.names.end(), "softened") - c.names.begin();
    for (const auto& row : c.rows) softened[starved].push_back(row[static_cast<std::size_t>(at)]);
  }
  EXPECT_THAT(softened[0], testing::Each(0));
  EXPECT_THAT(softened[1], testing::Contains(1));
}

TEST(StepTable, viscous_skin_and_friction_dissipate) {
  const Column t = parse(run(SceneModel(parse_scene_text(test::drag_scene(2, 8), "drag.json"))));
  EXPECT_GT(t.last("dissipated_skin_mJ"), 0);
  EXPECT_GT(t.last("dissipated_friction_finger_mJ"), 0);
  EXPECT_GT(t.last("dissipated_energy_mJ"), 0.05 * t.last("collider_work_mJ"));
  EXPECT_NEAR(t.last("work_contact_finger_mJ") + t.last("work_friction_finger_mJ"),
              t.last("collider_work_mJ"), 1e-12);
  EXPECT_LT(std::abs(t.last("energy_imbalance_mJ")), 1e-8 * t.last("collider_work_mJ"));
  EXPECT_GT(t.last("stored_energy_mJ"), 0);
  EXPECT_LT(t.last("min_J"), 1);
}

TEST(StepTable, a_continued_run_has_the_rows_and_bits_of_the_whole_run) {
  const SceneModel scene_model(parse_scene_text(test::drag_scene(2, 5), "drag.json"));
  const Model& model = scene_model.model();
  const std::string path = testing::TempDir() + "rhytid_state_" + std::to_string(getpid()) + ".bin";
  StepTable whole(model);
  std::string rows_at_2;
  State end;
  RunObserver observer;
  observer.step = [&](const StepEvent& e) {
    whole.add(e);
    end = e.state;
    if (e.record.frame != 2) return;
    write_checkpoint(path, {"me", 2, e.state, whole.carried()});
    rows_at_2 = whole.table().text();
  };
  RunOptions options = scene_model.run_options();
  ASSERT_TRUE(simulate(model, scene_model.native(), options, observer).complete);

  const auto checkpoint = read_checkpoint(path, "me");
  ASSERT_TRUE(checkpoint);
  StepTable rest(model);
  rest.restore(whole.table().text(), checkpoint->frame, checkpoint->carried, "steps.csv");
  EXPECT_EQ(rest.table().text(), rows_at_2);
  State continued;
  observer.step = [&](const StepEvent& e) {
    rest.add(e);
    continued = e.state;
  };
  options.frames_done = checkpoint->frame;
  ASSERT_TRUE(simulate(model, scene_model.native(), options, observer, &checkpoint->state).complete);
  EXPECT_EQ(continued.time, end.time);
  EXPECT_TRUE(continued.u == end.u);
  EXPECT_TRUE(continued.history == end.history);
  EXPECT_EQ(rest.table().text(), whole.table().text());

  EXPECT_THROW(read_checkpoint(path, "another scene"), InputError);
  EXPECT_THROW(StepTable(model).restore("a,b\n1,2\n", 2, checkpoint->carried, "steps.csv"), InputError);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 1);
  EXPECT_THROW(read_checkpoint(path, "me"), InputError);
  std::filesystem::remove(path);
  EXPECT_FALSE(read_checkpoint(path, "me"));
}

}  // namespace
}  // namespace rhytid::tools
