// The program with some of its verbs, called in the test's own process: arguments in, exit code and texts out.
#pragma once

#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tools/verb.h"

namespace rhytid::tools {

struct Outcome {
  int code;
  std::string out, err;
};

/// Runs "rhytid ARGUMENTS..." with these verbs (std::unique_ptr<Verb>, of any derived type).
template <class... Verbs>
Outcome call_program(const std::vector<std::string>& arguments, Verbs... verbs) {
  Program program{"rhytid", "test", {}, {}};
  (program.verbs.push_back(std::move(verbs)), ...);
  std::vector<const char*> argv = {"rhytid"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  std::ostringstream out, err;
  const int code = run_program(program, static_cast<int>(argv.size()), argv.data(), out, err);
  return {code, out.str(), err.str()};
}

}  // namespace rhytid::tools
