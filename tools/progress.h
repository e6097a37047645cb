// What a running verb says about itself, on stderr: one status line that rewrites itself on a terminal, plain
// lines in a log file, or one JSON object per line with --log-json. Results go to stdout and files, never
// through here.
#pragma once

#include <chrono>
#include <functional>
#include <iosfwd>
#include <string>

namespace rhytid::tools {

enum class ProgressStyle { status_line, plain_lines, json_lines };

/// The style for stderr: JSON when asked, else a status line on a terminal and plain lines otherwise.
ProgressStyle progress_style_for_stderr(bool log_json);

/// Not thread-safe: report from one thread. Rates: the status line is redrawn at most ten times a second;
/// plain lines appear for completed steps, at most one a second and always for the last; JSON has every
/// completed step and at most one iteration a second.
class Progress {
 public:
  using Clock = std::function<double()>;  ///< seconds, monotonic

  /// `clock` is for tests; empty means the steady clock.
  Progress(ProgressStyle style, std::ostream& out, Clock clock = {});
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Begins a named part of the work with `num_steps` steps (0 = not known, then no ETA).
  void stage(const std::string& name, int num_steps);
  /// Inside a step: iteration count and residual (any unit; the number is only shown).
  void iteration(int iteration, double residual);
  /// `step` steps of the stage are complete (1..num_steps).
  void step_done(int step);
  /// A line worth keeping: shown above the status line. Line breaks become spaces.
  void note(const std::string& text);
  void warning(const std::string& text);
  void error(const std::string& text);
  /// Ends the status line. Called by the destructor too.
  void finish();
  /// True after SIGINT or SIGTERM: stop at the next safe place, keep the state, return ExitCode::interrupted.
  bool interrupted() const;

 private:
  std::string status_text() const;
  void redraw(bool even_if_recent);
  void line(const char* kind, const std::string& text);
  void write_json_status(const char* event);

  ProgressStyle style_;
  std::ostream& out_;
  Clock clock_;
  std::string stage_;
  int num_steps_ = 0, step_ = 0, iteration_ = 0;
  double residual_ = 0;
  double start_ = 0;       ///< of the stage, s
  double last_shown_ = 0;  ///< s
  bool line_is_open_ = false;
};

/// Resident memory of this process [MB]; 0 when the system does not tell.
double resident_memory_mb();

/// "12 s", "3 min 05 s", "2 h 07 min".
std::string duration_text(double seconds);

/// The text with line breaks and tabs as single spaces, for one-line messages.
std::string one_line(const std::string& text);

}  // namespace rhytid::tools
