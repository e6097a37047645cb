// The forward program: the verbs that need the simulator alone, without Ceres, NLopt, OpenCV and Embree.
#include <iostream>

#include "tools/forward_verbs.h"
#include "tools/study/experiment.h"
#include "tools/threads.h"
#include "tools/verb.h"

int main(int argc, char** argv) {
  using namespace rhytid::tools;
  let_waiting_threads_sleep(argc, argv);
  Program program;
  program.name = "rhytid-forward";
  program.description = "Rhytid, forward only: simulates skin that is pushed and dragged over bone.";
  program.verbs = make_forward_verbs();
  program.formats = {{"experiment", experiment_schema, experiment_documentation}};
  return run_program(program, argc, argv, std::cout, std::cerr);
}
