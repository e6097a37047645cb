#include "tools/forward_run.h"

#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <ostream>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/terms/kernel_table.h"
#include "tools/earlier_run.h"
#include "tools/run_checkpoint.h"
#include "tools/run_observer.h"
#include "tools/run_record.h"
#include "tools/scene_argument.h"
#include "tools/step_table.h"

namespace rhytid::tools {
namespace {

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Of all threads of this process, s.
double cpu_now() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// A forward run: the model, its files and how far it came.
class ForwardRun {
 public:
  ForwardRun(VerbContext& context, const FrameOptions& options, FrameListener* listener)
      : started_(now()),
        context_(context),
        listener_(listener),
        scene_model_(load_scene_argument(context.options.file, context.options.settings, context.progress)),
        folder_(context.output_folder()),
        frames_(scene_model_, folder_, options),
        table_(scene_model_.model()),
        record_(folder_ + "/run.json", scene_model_, context),
        identity_(run_identity(scene_model_.scene(), scene_model_.model())) {}

  ExitCode go(bool resume) {
    const Scene& scene = scene_model_.scene();
    for (const std::string& w : scene_warnings(scene)) context_.progress.warning(w);
    RunOptions options = scene_model_.run_options();
    options.keep_states = false;
    State start = scene_model_.model().rest_state();
    if (resume && !listener_ && is_complete()) return ExitCode::ok;
    if (listener_) listener_->begin(scene_model_, folder_);
    record_.setup_seconds = now() - started_;
    if (!resume || !restore(options, start)) begin(start);
    record_.output_seconds = now() - started_ - record_.setup_seconds;

    context_.progress.stage("simulate", scene.time.frames * scene.time.substeps);
    if (options.frames_done > 0) context_.progress.step_done(options.frames_done * scene.time.substeps);
    RunObserver observer = progress_observer(context_.progress);
    observer.step = [&](const StepEvent& event) { keep(event); };
    solve_started_ = now();
    cpu_started_ = cpu_now();
    const Trajectory run = simulate(scene_model_.model(), scene_model_.native(), options, observer, &start);
    record_.solve_seconds += now() - solve_started_;
    record_.solve_cpu_seconds += cpu_now() - cpu_started_;
    context_.progress.finish();
    return finish(run);
  }

 private:
  const OutputScene& output() const { return scene_model_.scene().output; }
  bool is_written(int frame) const {
    return frame % output().every == 0 || frame == scene_model_.scene().time.frames;
  }

  void begin(const State& rest) {
    const auto earlier =
        files_of_earlier_run(folder_, listener_ ? listener_->files() : std::vector<std::string>());
    record_.write("running");  // from here on the folder is this run's, also when it is killed below
    for (const std::filesystem::path& file : earlier) {
      std::error_code error;
      if (!std::filesystem::remove(file, error) && error)
        throw InputError(file.string() + ": cannot be removed (" + error.message() + ")");
    }
    if (!earlier.empty())
      context_.progress.note("removed " + std::to_string(earlier.size()) + " files of an earlier run in " +
                             folder_);
    if (listener_) listener_->start(rest);
    // A settling step leads to frame 0 and writes it then.
    if (!scene_model_.run_options().settle) frames_.write(0, rest);
    write_table();
    record_.write("running");
  }

  /// Whether the folder holds this run with all its frames; nothing of it is touched then.
  bool is_complete() const {
    const auto checkpoint = read_checkpoint(folder_ + "/state.bin", identity_);
    const int frames = scene_model_.scene().time.frames;
    if (!checkpoint || checkpoint->frame < frames || recorded_status(folder_ + "/run.json") != "complete")
      return false;
    context_.out << shown_name(scene_model_.scene()) << ": complete already, " << checkpoint->frame
                 << " frames in " << folder_ << "; nothing was changed\n";
    return true;
  }

  /// False when there is nothing to resume from.
  bool restore(RunOptions& options, State& start) {
    std::string reason;
    try {
      if (restore_files(options, start)) return true;
    } catch (const InputError& error) {
      if (!listener_) throw InputError(std::string(error.what()) + "; without --resume it starts anew");
      // A study goes on from whatever is there: what cannot be gone on from is nothing.
      reason = std::string(" (") + error.what() + ")";
      table_ = StepTable(scene_model_.model());
    }
    const std::string text =
        "nothing to resume in " + folder_ + reason + ": the run starts from the beginning";
    if (listener_) {
      context_.progress.note(text);
    } else {
      context_.progress.warning(text);
    }
    return false;
  }

  /// False without a checkpoint. Throws InputError when it, or a table beside it, is not that of this run.
  bool restore_files(RunOptions& options, State& start) {
    auto checkpoint = read_checkpoint(folder_ + "/state.bin", identity_);
    if (!checkpoint) return false;
    const TimeScene& time = scene_model_.scene().time;
    if (output().csv) {
      const std::string path = folder_ + "/steps.csv";
      table_.restore(read_file(path), checkpoint->frame, checkpoint->carried, path);
    }
    if (listener_) listener_->resume(checkpoint->frame);
    for (int frame = 0; frame <= checkpoint->frame; ++frame)
      if (is_written(frame)) frames_.restore(frame, frame == 0 ? 0 : 1 / time.frame_rate * frame);
    options.settle = false;  // the checkpoint lies behind it
    options.frames_done = record_.frames_done = record_.resumed_from = checkpoint->frame;
    start = std::move(checkpoint->state);
    context_.progress.note("resumed after frame " + std::to_string(options.frames_done));
    return true;
  }

  void write_table() const {
    if (output().csv) table_.table().write(folder_ + "/steps.csv");
  }

  /// Files after a step; the time they take is not the solver's.
  void keep(const StepEvent& event) {
    const double began = now();
    record_.solve_seconds += began - solve_started_;
    record_.solve_cpu_seconds += cpu_now() - cpu_started_;
    record_.add(event.record);
    table_.add(event);
    const int frame = event.record.frame;
    if (event.frame_done) {
      record_.frames_done = frame;
      if (is_written(frame)) frames_.write(frame, event.state);
      write_table();
      if (listener_) listener_->frame(frame, event.state);
      write_checkpoint(folder_ + "/state.bin", {identity_, frame, event.state, table_.carried()});
    }
    record_.output_seconds += now() - began;
    record_.write("running");
    const TimeScene& time = scene_model_.scene().time;
    const double steps = event.state.time * time.frame_rate * time.substeps;
    context_.progress.step_done(static_cast<int>(std::floor(std::max(0., steps) + 1e-6)));
    solve_started_ = now();
    cpu_started_ = cpu_now();
  }

  ExitCode finish(const Trajectory& run) {
    write_table();
    const int frames = scene_model_.scene().time.frames;
    const bool interrupted = !run.complete && context_.progress.interrupted();
    const std::string where =
        std::to_string(record_.frames_done) + " of " + std::to_string(frames) + " frames";
    record_.write(run.complete ? "complete" : interrupted ? "interrupted" : "not_converged", run.failure);
    if (interrupted) {
      context_.progress.note("interrupted after " + where + "; the same command " +
                             (listener_ ? "" : "with --resume ") + "goes on");
      return ExitCode::interrupted;
    }
    if (!run.complete) {
      context_.progress.error(run.failure + "; " + where + " are kept in " + folder_);
      return ExitCode::not_converged;
    }
    print_summary();
    return ExitCode::ok;
  }

  void print_summary() const {
    const Scene& scene = scene_model_.scene();
    char text[256];
    std::snprintf(text, sizeof text,
                  "%d frames, %ld steps, %ld iterations; solving %.1f s, files %.1f s, setting up %.1f s\n",
                  record_.frames_done, record_.steps(), record_.iterations(), record_.solve_seconds,
                  record_.output_seconds, record_.setup_seconds);
    context_.out << shown_name(scene) << ": " << text << "written to " << folder_ << ": run.json";
    if (output().csv) context_.out << ", steps.csv";
    if (output().vtu) context_.out << ", frames.pvd, surface.pvd";
    if (output().pictures) context_.out << ", pictures/";
    context_.out << '\n';
  }

  double started_, solve_started_ = 0, cpu_started_ = 0;
  VerbContext& context_;
  FrameListener* listener_;
  SceneModel scene_model_;
  std::string folder_;
  FrameWriter frames_;
  StepTable table_;
  RunRecord record_;
  std::string identity_;
};

}  // namespace

ExitCode run_forward(VerbContext& context, const FrameOptions& options, bool resume,
                     FrameListener* listener) {
  return ForwardRun(context, options, listener).go(resume);
}

}  // namespace rhytid::tools
