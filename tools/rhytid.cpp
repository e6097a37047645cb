// The full program: simulate, track, fit, report.
#include <iostream>

#include "fitting/case_rules.h"
#include "tools/all_verbs.h"
#include "tools/environment.h"
#include "tools/study/experiment.h"
#include "tools/threads.h"

int main(int argc, char** argv) {
  using namespace rhytid::tools;
  let_waiting_threads_sleep(argc, argv);
  Program program;
  program.name = "rhytid";
  program.description =
      "Rhytid: a differentiable skin simulator that finds the retaining ligaments and moduli of a face from "
      "video.";
  program.verbs = make_all_verbs();
  program.environment_checks = {fitting_environment};
  program.formats = {{"case", rhytid::fitting::case_schema, rhytid::fitting::case_documentation},
                     {"experiment", experiment_schema, experiment_documentation}};
  return run_program(program, argc, argv, std::cout, std::cerr);
}
