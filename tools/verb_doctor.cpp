// rhytid doctor: is this machine fit to run the program?
#include <algorithm>
#include <ostream>

#include "tools/environment.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Doctor : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "doctor",
        "check the environment: BLAS, library versions, threads, video",
        "Prints what the program runs on: versions of the libraries, which library really answers the dense "
        "matrix products (dgemm_) under the sparse factorisation, processor, threads, and, in the full "
        "program, "
        "which video formats can be written. A factorisation over another BLAS than OpenBLAS is several "
        "times "
        "slower, so that counts as a failed check.",
        "nothing",
        "a table on stdout, each checked line marked 'ok' or 'BAD'; exit code 3 when a check failed",
        "rhytid doctor"};
  }
  bool takes_file() const override { return false; }

  ExitCode run(VerbContext& context) override {
    std::vector<EnvironmentFact> facts = simulator_environment(context.options.threads);
    for (const auto& check : context.program.environment_checks) {
      for (EnvironmentFact& fact : check()) facts.push_back(std::move(fact));
    }
    std::size_t width = 0;
    for (const EnvironmentFact& fact : facts) width = std::max(width, fact.name.size());
    bool all_good = true;
    for (const EnvironmentFact& fact : facts) {
      const bool is_bad = fact.verdict == EnvironmentFact::Verdict::bad;
      const bool is_good = fact.verdict == EnvironmentFact::Verdict::good;
      all_good = all_good && !is_bad;
      context.out << (is_bad    ? "BAD  "
                      : is_good ? "ok   "
                                : "     ")
                  << fact.name << std::string(width - fact.name.size() + 2, ' ') << fact.value << '\n';
    }
    if (!all_good) context.progress.error("this environment fails the checks marked BAD");
    return all_good ? ExitCode::ok : ExitCode::not_converged;
  }
};

}  // namespace

std::unique_ptr<Verb> make_verb_doctor() {
  return std::make_unique<Doctor>();
}

}  // namespace rhytid::tools
