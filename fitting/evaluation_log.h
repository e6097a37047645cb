// What a fit has computed so far, on disk: every completed forward run and every derivative, each under the
// exact values it was taken at. A fit that was killed and is started again finds them and goes on where it
// was; the optimiser cannot tell a replayed evaluation from a fresh one, so both end at the same bits.
//
//   FOLDER/identity.json   what the evaluations depend on, one digest per part
//   FOLDER/run-0001.bin, tangent-0001.bin, adjoint-0001.bin, points-0001.bin, ...
//           a line of JSON, then t and the values as doubles in this machine's byte order
//
// A file appears whole or not at all. A log of another identity is set aside as FOLDER.old (.old2, …), never
// mixed in, and taken back when its fit is asked for again. Tests: tests/fitting/resume_test.cpp
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

struct FitCase;
struct FitClip;
struct FitInput;
class FitProblem;

/// Part (program, scene, camera, tracks, parameters) and digest of what it holds, in that order.
using FitIdentity = std::vector<std::pair<std::string, std::string>>;

/// Everything that decides the bits of an evaluation, files that the scene names included. The optimiser and
/// its budget are not among it, so a fit may be given more evaluations and goes on. Another build of the
/// program is another program.
FitIdentity fit_identity(const FitInput& input, const FitProblem& problem);
FitIdentity fit_identity(const FitClip& clip, const FitCase& options, const FitProblem& problem);

class EvaluationLog {
 public:
  enum class Kind { run, tangent, adjoint, points };
  /// One evaluation; failure is empty or the sentence that says why there are no values.
  struct Record {
    std::string failure;
    double seconds = 0;  ///< that it took when it was computed
    MatrixXd values = {};
  };

  /// Opens the log in `folder`, or begins one. `anew` sets an older one aside even when it matches. Throws
  /// InputError when the folder cannot be made.
  EvaluationLog(std::string folder, const FitIdentity& identity, bool anew = false);

  /// What became of older logs that were set aside or taken back, one line; empty when there were none.
  const std::string& set_aside() const { return set_aside_; }
  int num_runs() const { return num_runs_; }  ///< forward runs found on opening

  /// The record at t to the last bit, if there is one. A damaged file counts as none.
  std::optional<Record> find(Kind kind, const VectorXd& t) const;
  /// Keeps it. A disk that takes no more ends the keeping, not the fit: `warn` is told once.
  void add(Kind kind, const VectorXd& t, const Record& record);

  std::function<void(const std::string&)> warn;

 private:
  using Key = std::pair<Kind, std::string>;  ///< kind and the bytes of t
  void move_old(const std::string& reason);
  /// Where a log of this identity was set aside earlier, it becomes the log again.
  void take_back(const FitIdentity& identity);
  void read_index();

  std::string folder_, set_aside_;
  std::map<Key, std::string> files_;
  int num_runs_ = 0, last_number_ = 0;
  bool is_writable_ = true;
};

}  // namespace rhytid::fitting
