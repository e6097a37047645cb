#include "tools/bench/tracker_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <opencv2/core/utility.hpp>

#include "fitting/case_rules.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/bench/filming.h"
#include "tools/share_check.h"
#include "tools/text_table.h"

namespace rhytid::tools {
namespace {

struct NamedSkin {
  std::string name;
  std::unique_ptr<FilmedSkin> skin;
};

std::vector<std::string> cells(const TrackingScore& s) {
  return {s.filming,
          std::to_string(s.started),
          fixed_text(100 * s.kept, 0),
          fixed_text(100. * s.observations / std::max(1, s.expected), 0),
          fixed_text(s.rms_px, 4),
          fixed_text(s.bias_px, 4),
          fixed_text(s.sigma_px, 4),
          fixed_text(s.normalised, 2),
          std::to_string(s.gross),
          refusals_text(s)};
}

const std::vector<std::string> kHeader = {"filmed",        "tracks",   "kept, %",   "seen, %",
                                          "rms, px",       "bias, px", "sigma, px", "error / sigma",
                                          "off by > 1 px", "refused"};

std::string markdown(const std::vector<TrackingScore>& scores) {
  std::string text, skin;
  const auto row = [&text](const std::vector<std::string>& values) {
    text += "|";
    for (const std::string& v : values) text += " " + v + " |";
    text += "\n";
  };
  for (const TrackingScore& s : scores) {
    if (s.skin != skin) {
      skin = s.skin;
      text += (text.empty() ? "## " : "\n## ") + skin + "\n\n";
      row(kHeader);
      row(std::vector<std::string>(kHeader.size(), "---"));
    }
    row(cells(s));
  }
  return text;
}

void write_csv(const std::string& path, const std::vector<TrackingScore>& scores) {
  std::vector<CsvColumn> columns = {
      {"skin", ""},      {"filming", ""},      {"tracks", ""},   {"kept", ""},
      {"expected", ""},  {"observations", ""}, {"rms", "px"},    {"bias", "px"},
      {"sigma", "px"},   {"normalised", ""},   {"gross", ""},    {"normalised_with_gross", ""},
      {"noise", "grey"}, {"jitter", "px"},     {"exposure", ""}, {"template_updates", ""},
      {"redetected", ""}};
  for (int i = 1; i < fitting::kNumRefusals; ++i)
    columns.push_back({std::string("refused_") + to_string(static_cast<fitting::Refusal>(i)), ""});
  CsvTable table(columns);
  const auto whole = [](int value) { return CsvCell(std::int64_t{value}); };
  for (const TrackingScore& s : scores) {
    std::vector<CsvCell> row = {s.skin,
                                s.filming,
                                whole(s.started),
                                s.kept,
                                whole(s.expected),
                                whole(s.observations),
                                s.rms_px,
                                s.bias_px,
                                s.sigma_px,
                                s.normalised,
                                whole(s.gross),
                                s.normalised_all,
                                s.noise_grey,
                                s.jitter_px,
                                s.exposure,
                                whole(s.template_updates),
                                whole(s.redetected)};
    for (int i = 1; i < fitting::kNumRefusals; ++i) row.push_back(whole(s.refusals[static_cast<size_t>(i)]));
    table.add_row(std::move(row));
  }
  table.write(path);
}

std::string plot(const std::vector<TrackingScore>& scores) {
  BarChart chart;
  chart.title = "error over stated deviation (1: covariances are right)";
  chart.y.label = "rms";
  for (const TrackingScore& s : scores) {
    if (std::find(chart.series.begin(), chart.series.end(), s.skin) == chart.series.end())
      chart.series.push_back(s.skin);
    if (std::none_of(chart.groups.begin(), chart.groups.end(),
                     [&s](const BarGroup& g) { return g.label == s.filming; }))
      chart.groups.push_back({.label = s.filming, .values = {}, .errors = {}});
  }
  for (BarGroup& group : chart.groups)
    for (const std::string& skin : chart.series) {
      const auto found = std::find_if(scores.begin(), scores.end(), [&](const TrackingScore& s) {
        return s.skin == skin && s.filming == group.label;
      });
      group.values.push_back(found == scores.end() ? std::numeric_limits<double>::quiet_NaN()
                                                   : found->normalised);
    }
  chart.width = std::max(640, 90 * static_cast<int>(chart.groups.size()));
  return svg(chart);
}

class TrackerBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    std::string names;
    for (const Filming& f : filmings())
      names += (names.empty() ? "" : "; ") + f.name + " (" + f.description + ")";
    return {"tracker",
            "the tracker under bad light, motion blur, head motion and occlusion, against exact motion",
            "Films skins whose motion is known in many ways, tracks them as `rhytid track` does by default, "
            "and tells how many "
            "tracks are kept, rms error and bias in px per axis, the errors over their stated deviations (1 "
            "when the "
            "covariances are right), how many observations are more than 1 px off, and what was refused why. "
            "Skins: "
            "a speckle; with CASE also its twin footage; with --picture also a real picture as texture. "
            "Writes tracker.csv, "
            "tracker.md and tracker.svg into -o DIR. Filmed: " +
                names + "."};
  }
  void add_options(CLI::App& app) override {
    CLI::Option* of_case =
        app.add_option("case", case_,
                       "a case whose truth is filmed too, e.g. data/scenes/coarse_swipe/case.json")
            ->option_text("CASE");
    app.add_option("--set", settings_, "change one value of the case; may be repeated")
        ->needs(of_case)
        ->option_text("/POINTER=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    CLI::Option* picture = app.add_option("--picture", picture_,
                                          "a picture or video with a face; a frame of it is a texture too");
    app.add_option("--picture-frame", picture_frame_, "which frame (default 0)")
        ->needs(picture)
        ->check(CLI::Range(0, 1000000));
    app.add_option("--picture-region", region_, "where its points are followed, px (default: the middle)")
        ->needs(picture)
        ->option_text("X,Y,WIDTH,HEIGHT")
        ->delimiter(',')
        ->expected(4);
    app.add_option("--filmed", filmed_, "these only")->delimiter(',')->option_text("NAME,...");
    app.add_option("--frames", frames_, "of each film (default 16)")->check(CLI::Range(3, 1000));
    app.add_option("--window", window_, "side of the tracker's window, px (default 21)")
        ->check(CLI::Range(7, 201));
    app.add_option("--exposure", exposure_,
                   "track with --exposure FRACTION (default: found out from the blur)")
        ->option_text("FRACTION")
        ->check(share_check());
    app.add_option("--seed", seed_, "of texture and noise (default 1)");
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    if (window_ % 2 == 0) throw InputError("--window", std::to_string(window_), "an odd number of pixels");
    cv::setNumThreads(context.options.threads);
    const std::vector<Filming> wanted = wanted_filmings();
    std::vector<NamedSkin> skins;
    if (!make_skins(skins, folder, context.progress)) return ExitCode::interrupted;
    std::vector<TrackingScore> scores;
    context.progress.stage("track", static_cast<int>(skins.size() * wanted.size()));
    for (const NamedSkin& s : skins)
      for (const Filming& filming : wanted) {
        fitting::TrackerOptions options;
        options.window_px = window_;
        options.exposure = exposure_;
        options.seeds.min_distance_px = 10;
        options.seeds.max_tracks = 120;
        scores.push_back(score_filming(*s.skin, filming, options, seed_, folder));
        scores.back().skin = s.name;
        context.progress.step_done(static_cast<int>(scores.size()));
        write_csv(folder + "/tracker.csv", scores);
        if (context.progress.interrupted()) return ExitCode::interrupted;
      }
    write_file(folder + "/tracker.md", markdown(scores));
    write_file(folder + "/tracker.svg", plot(scores));
    std::vector<std::string> header = kHeader;
    header.insert(header.begin(), "skin");
    TextTable table(header);
    for (const TrackingScore& s : scores) {
      std::vector<std::string> row = cells(s);
      row.insert(row.begin(), s.skin);
      table.add(row);
    }
    context.out << table.text() << folder << "/tracker.md\n";
    return ExitCode::ok;
  }

 private:
  std::vector<Filming> wanted_filmings() const {
    if (filmed_.empty()) return filmings();
    std::vector<Filming> list;
    for (const std::string& name : filmed_) {
      const auto& all = filmings();
      const auto same =
          std::find_if(all.begin(), all.end(), [&](const Filming& f) { return f.name == name; });
      if (same == all.end())
        throw InputError("--filmed", "'" + name + "'", "names that `rhytid bench tracker --help` lists");
      list.push_back(*same);
    }
    return list;
  }

  bool make_skins(std::vector<NamedSkin>& skins, const std::string& folder, Progress& progress) const {
    constexpr int kInset = 45;  // px: the head rolls, windows must stay in the picture
    const cv::Size size(360, 270);
    const cv::Rect inner(kInset, kInset, size.width - 2 * kInset, size.height - 2 * kInset);
    skins.push_back({"speckle", make_plane_skin(speckle_texture(size, seed_), 2, size, frames_, inner)});
    if (!case_.empty()) {
      const fitting::Case c = fitting::load_case(case_, settings_);
      skins.push_back({"twin of " + c.name, make_twin_skin(c, frames_, folder, progress)});
      if (!skins.back().skin) return false;
    }
    if (!picture_.empty()) skins.push_back({"picture", picture_skin(kInset)});
    return true;
  }

  std::unique_ptr<FilmedSkin> picture_skin(int inset) const {
    fitting::FrameSourceOptions options;
    options.path = picture_;
    options.first = options.last = picture_frame_;
    const std::optional<fitting::Frame> frame = fitting::FrameSource(options).next();
    if (!frame)
      throw InputError(picture_, "no frame " + std::to_string(picture_frame_),
                       "a picture, or a frame of a video");
    const cv::Size size(frame->grey.cols / 2 * 2, frame->grey.rows / 2 * 2);
    cv::Rect region(inset, inset, size.width - 2 * inset, size.height - 2 * inset);
    if (!region_.empty()) region = cv::Rect(region_[0], region_[1], region_[2], region_[3]);
    if (region.empty() || (region & cv::Rect({0, 0}, size)) != region)
      throw InputError(
          "--picture-region",
          "not inside " + std::to_string(size.width) + " x " + std::to_string(size.height) + " px",
          "a region of the picture");
    return make_plane_skin(frame->grey, 1, size, frames_, region);
  }

  std::string case_, picture_;
  std::vector<std::string> settings_, filmed_;
  std::vector<int> region_;
  int picture_frame_ = 0, frames_ = 16, window_ = 21;
  unsigned seed_ = 1;
  std::optional<double> exposure_;
};

}  // namespace

std::unique_ptr<Benchmark> make_tracker_benchmark() {
  return std::make_unique<TrackerBenchmark>();
}

}  // namespace rhytid::tools
