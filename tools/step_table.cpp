#include "tools/step_table.h"

#include <sstream>

#include "sim/core/error.h"

namespace rhytid::tools {
namespace {

std::vector<CsvColumn> columns(const Model& model) {
  std::vector<CsvColumn> list = {{"step", ""}, {"frame", ""}, {"time", "s"}, {"dt", "s"}};
  for (const Term& term : model.terms)
    list.push_back({column_name(term.name()) +
                        (energy_kind(term) == EnergyKind::incremental ? "_incremental" : "_energy"),
                    "mJ"});
  for (const char* name : {"stored_energy", "collider_work", "dissipated_estimate"})
    list.push_back({name, "mJ"});
  for (const char* name : {"iterations", "evaluations", "factorisations", "bisections"})
    list.push_back({name, ""});
  list.push_back({"residual", "N"});
  list.push_back({"tolerance", "N"});
  list.push_back({"smallest_pivot", "N_per_mm"});
  list.push_back({"min_J", ""});
  list.push_back({"max_displacement", "mm"});
  for (const std::string& body : contact_names(model)) {
    for (const char* axis : {"x", "y", "z"}) list.push_back({"force_" + body + "_" + axis, "N"});
    list.push_back({"penetration_" + body, "mm"});
  }
  return list;
}

/// Where the bodies stand at time 0, untouched.
std::vector<ContactReading> bodies_at_rest(const Model& model) {
  const State rest = model.rest_state();
  const StepInfo standstill{0, -1e-9, 0};
  return read_step(StepProblem(model, model.native, standstill, rest), rest).contacts;
}

}  // namespace

StepTable::StepTable(const Model& model)
    : num_bodies_(contact_names(model).size()), table_(columns(model)), last_(bodies_at_rest(model)) {}

void StepTable::advance_work(const StepReading& reading) {
  // The skin pushes the body by `force`, so the body does −force·motion on the skin.
  for (std::size_t k = 0; k < num_bodies_; ++k)
    work_ -=
        0.5 * (last_[k].force + reading.contacts[k].force).dot(reading.contacts[k].centre - last_[k].centre);
  last_ = reading.contacts;
}

void StepTable::add(const StepEvent& event) {
  const StepReading reading = read_step(event.problem, event.state);
  advance_work(reading);
  if (event.record.frame == 0) work_ = reading.stored;  // what it took to put the skin under tension
  const MinimiserReport& report = event.record.report;
  const auto count = [](auto n) { return CsvCell(static_cast<std::int64_t>(n)); };
  std::vector<CsvCell> row = {count(table_.num_rows() + 1), count(event.record.frame), event.record.step.t,
                              event.record.step.dt()};
  for (const double energy : reading.energies) row.emplace_back(energy);
  for (const double energy : {reading.stored, work_, work_ - reading.stored}) row.emplace_back(energy);
  for (const int n : {report.iterations, report.evaluations, report.factorisations, event.record.bisections})
    row.push_back(count(n));
  for (const double value : {report.residual, report.tolerance, report.smallest_pivot,
                             reading.smallest_jacobian, reading.largest_displacement})
    row.emplace_back(value);
  for (const ContactReading& c : reading.contacts)
    for (const double value : {c.force[0], c.force[1], c.force[2], c.penetration}) row.emplace_back(value);
  table_.add_row(std::move(row));
}

std::vector<double> StepTable::carried() const {
  std::vector<double> values = {work_};
  for (const ContactReading& c : last_)
    for (const Vec3& v : {c.force, c.centre}) values.insert(values.end(), v.data(), v.data() + 3);
  return values;
}

void StepTable::restore(const std::string& csv, int last_frame, const std::vector<double>& carried,
                        const std::string& path) {
  const auto refuse = [&] {
    throw InputError(path, "a table that does not belong to this run", "the steps.csv that the run wrote");
  };
  std::istringstream lines(csv);
  std::string line;
  if (!std::getline(lines, line) || line + "\n" != table_.text() || carried.size() != 1 + 6 * num_bodies_)
    refuse();
  while (std::getline(lines, line)) {
    // Numbers only, so that the cells are the text between commas; kept as text they come back unchanged.
    std::vector<CsvCell> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.emplace_back(cell);
    if (cells.size() < 2) refuse();
    if (std::stoi(std::get<std::string>(cells[1])) > last_frame) break;
    table_.add_row(std::move(cells));
  }
  work_ = carried[0];
  for (std::size_t k = 0; k < num_bodies_; ++k) {
    last_[k].force = Vec3(carried.data() + 1 + 6 * k);
    last_[k].centre = Vec3(carried.data() + 4 + 6 * k);
  }
}

}  // namespace rhytid::tools
