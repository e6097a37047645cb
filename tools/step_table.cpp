#include "tools/step_table.h"

#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::tools {
namespace {

bool may_dissipate(const Term& term) {
  return term.kernels().ns > 0;
}

bool has_moving_body(const Term& term) {
  return term.name().starts_with("contact ") || term.name().starts_with("friction ");
}

/// Columns that sum over the run.
std::vector<std::string> summed_columns(const Model& model) {
  std::vector<std::string> names;
  for (const Term& term : model.terms) {
    if (may_dissipate(term)) names.push_back("dissipated_" + column_name(term.name()));
    if (has_moving_body(term)) names.push_back("work_" + column_name(term.name()));
  }
  for (const char* total :
       {"collider_work", "rim_work", "dissipated_energy", "numerical_dissipation", "energy_imbalance"})
    names.emplace_back(total);
  return names;
}

std::vector<CsvColumn> columns(const Model& model) {
  std::vector<CsvColumn> list = {{"step", ""}, {"frame", ""}, {"time", "s"}, {"dt", "s"}};
  for (const Term& term : model.terms)
    list.push_back({column_name(term.name()) +
                        (energy_kind(term) == EnergyKind::incremental ? "_incremental" : "_energy"),
                    "mJ"});
  for (const Term& term : model.terms)
    for (int part = 0; part < term.kernels().num_stored; ++part) {
      const std::string suffix = term.kernels().num_stored > 1
                                     ? std::string("_") + term.kernels().stored_names[part]
                                     : std::string();
      list.push_back({"stored_" + column_name(term.name()) + suffix, "mJ"});
    }
  list.push_back({"stored_energy", "mJ"});
  for (const std::string& name : summed_columns(model)) list.push_back({name, "mJ"});
  for (const char* name : {"iterations", "evaluations", "factorisations", "bisections", "softened"})
    list.push_back({name, ""});
  list.push_back({"pass_change", "mm"});
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

/// What a step adds to each of summed_columns.
std::vector<double> summed_values(const Model& model, const EnergyAccount& account) {
  std::vector<double> values;
  for (std::size_t k = 0; k < model.terms.size(); ++k) {
    if (may_dissipate(model.terms[k])) values.push_back(account.terms[k].dissipated);
    if (has_moving_body(model.terms[k])) values.push_back(account.terms[k].work);
  }
  for (const double total :
       {account.work, account.rim_work, account.dissipated, account.numerical, account.imbalance})
    values.push_back(total);
  return values;
}

}  // namespace

StepTable::StepTable(const Model& model) : table_(columns(model)), sums_(summed_columns(model).size(), 0.0) {}

void StepTable::add(const StepEvent& event) {
  const StepReading reading = read_step(event.problem, event.state);
  const EnergyAccount account = account_step(event.problem, event.state);
  // What it took to put the skin under tension before frame 0 is nobody's work.
  if (event.record.frame > 0) {
    const std::vector<double> added = summed_values(event.problem.model(), account);
    for (std::size_t k = 0; k < sums_.size(); ++k) sums_[k] += added[k];
  }
  const MinimiserReport& report = event.record.report;
  const auto count = [](auto n) { return CsvCell(static_cast<std::int64_t>(n)); };
  std::vector<CsvCell> row = {count(table_.num_rows() + 1), count(event.record.frame), event.record.step.t,
                              event.record.step.dt()};
  for (const double energy : reading.energies) row.emplace_back(energy);
  for (const TermAccount& term : account.terms)
    for (const StoredPart& part : term.stored) row.emplace_back(part.energy);
  row.emplace_back(account.stored);
  for (const double sum : sums_) row.emplace_back(sum);
  for (const int n : {report.iterations, report.evaluations, report.factorisations, event.record.bisections,
                      event.record.softened ? 1 : 0})
    row.push_back(count(n));
  for (const double value : {event.record.pass_change, report.residual, report.tolerance,
                             report.smallest_pivot, reading.smallest_jacobian, reading.largest_displacement})
    row.emplace_back(value);
  for (const ContactReading& c : reading.contacts)
    for (const double value : {c.force[0], c.force[1], c.force[2], c.penetration}) row.emplace_back(value);
  table_.add_row(std::move(row));
}

std::vector<double> StepTable::carried() const {
  return sums_;
}

void StepTable::restore(const std::string& csv, int last_frame, const std::vector<double>& carried,
                        const std::string& path) {
  const auto refuse = [&](const std::string& found) {
    throw InputError(path, found, "the steps.csv that the run wrote");
  };
  if (carried.size() != sums_.size()) refuse("a table that does not belong to this run");
  double rows = 0, frame = 0;
  table_.restore(csv, path, [&](const std::vector<double>& row) {  // step and frame lead the columns
    if (row[1] > last_frame) return false;
    ++rows;
    if (row[0] != rows) refuse("step " + short_text(row[0]) + " in row " + short_text(rows));
    frame = row[1];
    return true;
  });
  if (frame != last_frame)
    refuse("steps as far as frame " + short_text(frame) + ", not " + std::to_string(last_frame));
  sums_ = carried;
}

std::string step_table_documentation() {
  return R"(# The columns of steps.csv

One row per converged step; the header carries the units. NAME stands for an energy term of the scene (`skin_elastic`,
`ligaments`, `base_contact`, `contact_finger`, `friction_finger`, ...) or for a body (`base`, or a collider's name).

| column | unit | meaning |
| --- | --- | --- |
| `step` | | number of the row, from 1 |
| `frame` | | frame that the step leads to or lies before; 0: the skin settles under its pre-stretch or displaced held parts |
| `time` | s | end of the step |
| `dt` | s | its length; shorter than usual after a bisection |
| `NAME_energy` | mJ | energy of a term that is a function of the shape alone, now |
| `NAME_incremental` | mJ | the same of a term whose energy in a step includes what the step dissipates: viscous skin, friction |
| `stored_NAME` | mJ | what a term has stored now; `stored_NAME_PART` when it stores in several parts |
| `stored_energy` | mJ | sum of what is stored |
| `dissipated_NAME` | mJ | dissipated by a term since the start |
| `work_NAME` | mJ | done by a moving body on the skin through a term since the start |
| `collider_work` | mJ | done by all moving bodies since the start |
| `rim_work` | mJ | done by a moving rim since the start |
| `dissipated_energy` | mJ | dissipated by all terms since the start |
| `numerical_dissipation` | mJ | lost to the time discretisation since the start |
| `energy_imbalance` | mJ | what the account leaves over: work - stored - dissipated - numerical, by rounding and tolerance |
| `iterations` | | iterations of the solve that gave the step |
| `evaluations` | | evaluations of the energy, also for guesses and attempts that were given up |
| `factorisations` | | factorisations of the Hessian, likewise |
| `bisections` | | how often the step was halved |
| `softened` | | 1 when the step started from softened contacts |
| `pass_change` | mm | how far the last of `/time/lag_passes` still moved the skin; 0 with one pass |
| `residual` | N | norm of the gradient at the end |
| `tolerance` | N | below which the step counts as converged |
| `smallest_pivot` | N/mm | of the Hessian's factor; near 0: near to losing stability |
| `min_J` | | smallest ratio of volumes det F in the skin; below 0 an element would be inside out |
| `max_displacement` | mm | largest displacement of a node |
| `force_NAME_x`, `_y`, `_z` | N | force of the skin on a body, friction included |
| `penetration_NAME` | mm | how deep the skin is in a body at most; 0 when they do not touch |
)";
}

}  // namespace rhytid::tools
