#include "tools/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <ostream>

#include "tools/interrupt.h"

namespace rhytid::tools {
namespace {

constexpr double redraw_interval = 0.1;  // s; faster only costs time
constexpr double line_interval = 1.0;    // s, for log files
constexpr double never = -std::numeric_limits<double>::infinity();

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

std::size_t terminal_width() {
  winsize size = {};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

ProgressStyle progress_style_for_stderr(bool log_json) {
  if (log_json) return ProgressStyle::json_lines;
  const char* terminal = std::getenv("TERM");
  const bool can_rewrite = terminal != nullptr && std::strcmp(terminal, "dumb") != 0;
  return can_rewrite && isatty(STDERR_FILENO) == 1 ? ProgressStyle::status_line : ProgressStyle::plain_lines;
}

Progress::Progress(ProgressStyle style, std::ostream& out, Clock clock)
    : style_(style), out_(out), clock_(std::move(clock)), last_shown_(never) {
  if (!clock_) {
    clock_ = [] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    };
  }
  start_ = clock_();
}

Progress::~Progress() {
  finish();
}

void Progress::stage(const std::string& name, int num_steps) {
  finish();
  stage_ = name;
  num_steps_ = num_steps;
  step_ = iteration_ = 0;
  residual_ = std::numeric_limits<double>::quiet_NaN();
  start_ = clock_();
  last_shown_ = never;
  if (style_ == ProgressStyle::json_lines) write_json_status("stage");
  if (style_ == ProgressStyle::plain_lines) {
    out_ << stage_ << (num_steps_ > 0 ? ": " + std::to_string(num_steps_) + " steps" : "") << std::endl;
  }
}

void Progress::iteration(int iteration, double residual) {
  iteration_ = iteration;
  residual_ = residual;
  if (style_ == ProgressStyle::status_line) redraw(false);
  if (style_ == ProgressStyle::json_lines && clock_() - last_shown_ >= line_interval) {
    write_json_status("iteration");
  }
}

void Progress::step_done(int step) {
  step_ = step;
  const bool is_last = num_steps_ > 0 && step_ >= num_steps_;
  if (style_ == ProgressStyle::status_line) redraw(is_last);
  if (style_ == ProgressStyle::json_lines) write_json_status("step");
  if (style_ == ProgressStyle::plain_lines && (is_last || clock_() - last_shown_ >= line_interval)) {
    out_ << status_text() << std::endl;
    last_shown_ = clock_();
  }
}

void Progress::note(const std::string& text) {
  line("note", text);
}
void Progress::warning(const std::string& text) {
  line("warning", text);
}
void Progress::error(const std::string& text) {
  line("error", text);
}

void Progress::finish() {
  if (!line_is_open_) return;
  out_ << std::endl;
  line_is_open_ = false;
}

bool Progress::interrupted() const {
  return interrupt_requested();
}

std::string Progress::status_text() const {
  const double elapsed = clock_() - start_;
  std::string text = stage_;
  if (num_steps_ > 0) {
    text += " " + std::to_string(step_) + "/" + std::to_string(num_steps_);
  } else if (step_ > 0) {
    text += " " + std::to_string(step_);
  }
  if (iteration_ > 0) {
    text += ", iteration " + std::to_string(iteration_);
    if (std::isfinite(residual_)) text += format(", residual %.1e", residual_);
  }
  text += ", " + duration_text(elapsed);
  if (num_steps_ > 0 && step_ > 0 && step_ < num_steps_) {
    text += ", " + duration_text(elapsed / step_ * (num_steps_ - step_)) + " left";
  }
  return text + format(", %.0f MB", resident_memory_mb());
}

void Progress::redraw(bool even_if_recent) {
  if (!even_if_recent && clock_() - last_shown_ < redraw_interval) return;
  last_shown_ = clock_();
  // \r to the line's start, ESC[K clears what a longer text left behind.
  out_ << '\r' << status_text().substr(0, terminal_width() - 1) << "\x1b[K" << std::flush;
  line_is_open_ = true;
}

void Progress::line(const char* kind, const std::string& text) {
  if (style_ == ProgressStyle::json_lines) {
    const nlohmann::ordered_json object = {{"event", kind}, {"text", one_line(text)}};
    out_ << object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
    return;
  }
  if (line_is_open_) out_ << "\r\x1b[K";
  if (std::strcmp(kind, "note") != 0) out_ << "rhytid: " << kind << ": ";
  out_ << one_line(text) << std::endl;
  if (line_is_open_) redraw(true);
}

void Progress::write_json_status(const char* event) {
  nlohmann::ordered_json object = {{"event", event}, {"stage", stage_}, {"step", step_}};
  if (num_steps_ > 0) object["steps"] = num_steps_;
  if (iteration_ > 0) object["iteration"] = iteration_;
  if (std::isfinite(residual_)) object["residual"] = residual_;
  object["seconds"] = clock_() - start_;
  object["memory_mb"] = std::round(resident_memory_mb());
  out_ << object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
  last_shown_ = clock_();
}

double resident_memory_mb() {
  // Second field of statm: resident pages.
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0, resident_pages = 0;
  if (!(statm >> total_pages >> resident_pages)) return 0;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

std::string duration_text(double seconds) {
  const long whole = std::lround(std::max(0.0, seconds));
  char text[64];
  if (whole < 60) {
    std::snprintf(text, sizeof text, "%ld s", whole);
  } else if (whole < 3600) {
    std::snprintf(text, sizeof text, "%ld min %02ld s", whole / 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%ld h %02ld min", whole / 3600, whole / 60 % 60);
  }
  return text;
}

std::string one_line(const std::string& text) {
  std::string result;
  for (const char c : text) {
    const bool is_break = c == '\n' || c == '\r' || c == '\t';
    if (!is_break) {
      result += c;
    } else if (!result.empty() && result.back() != ' ') {
      result += ' ';
    }
  }
  while (!result.empty() && result.back() == ' ') result.pop_back();
  return result;
}

}  // namespace rhytid::tools
