// rhytid calibrate: photographs of a checkerboard to a camera file.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <ostream>
#include <string_view>

#include "fitting/board_search.h"
#include "fitting/calibration_files.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/core/units.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

class Calibrate : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "calibrate",
        "photographs of a checkerboard to a camera file",
        "Finds the board in every photograph to a few hundredths of a pixel, fits focal lengths, principal "
        "point and as much distortion as the photographs determine, and says how sure each number is. "
        "Photographs without the board, or at odds with the others, are named and left out. Take ten or "
        "more with the lens and the focus of the footage, the board tilted to all sides and held into all "
        "parts of the picture. With --extrinsic the board says where the world is; without it the world "
        "is the camera's frame.",
        "photographs of one camera, all of one size, of a flat checkerboard that is seen whole",
        "camera.yaml (as /camera of a case), calibration.json, calibration.svg (what is left, over the "
        "picture); the lens with its intervals on stdout",
        "rhytid calibrate photographs/*.jpg --board 9x6 --square 25 -o run/camera"};
  }
  bool takes_file() const override { return false; }

  void add_options(CLI::App& app) override {
    app.add_option("photographs", files_, "photographs of the board")
        ->required()
        ->option_text("PHOTOGRAPHS...");
    app.add_option("--board", board_,
                   "inner corners of the board, where four squares meet: 9x6 for 10 by 7 squares (default: "
                   "what most photographs show)")
        ->option_text("CxR");
    app.add_option("--square", square_, "side of a square, mm (needed with --extrinsic)")->option_text("MM");
    app.add_option(
           "--extrinsic", extrinsic_,
           "photograph whose board is the world: x along its columns, to the right as seen, y along its "
           "rows, z away from the camera, origin at the inner corner where they begin")
        ->option_text("PHOTOGRAPH");
    app.add_option("--name", name_, "name of the camera (camera)")->option_text("NAME");
    app.add_option("-o,--output", output_, "folder for results (default run/calibration)")
        ->option_text("DIR");
  }

  ExitCode run(VerbContext& context) override {
    cv::setNumThreads(context.options.threads);
    const double square = square_of_board();
    std::optional<fitting::BoardSize> wanted;
    if (!board_.empty()) wanted = fitting::parse_board_size(board_, "--board");
    if (!extrinsic_.empty()) fitting::read_photograph(extrinsic_);  // before the work, not after it

    Progress& progress = context.progress;
    progress.stage("look for boards", static_cast<int>(files_.size()));
    auto search = fitting::find_boards(files_, wanted, [&progress](int done) {
      progress.step_done(done);
      return !progress.interrupted();
    });
    if (!search) return ExitCode::interrupted;
    for (const fitting::CalibrationPhotograph& p : search->photographs)
      if (p.board.corners.empty()) progress.warning(p.file + " is left out: " + p.reason);

    progress.stage("fit the lens", 0);
    fitting::CalibrationOptions options;
    options.square = square;
    options.progress = [&progress](int done, int) {
      progress.iteration(done, 0);
      return !progress.interrupted();
    };
    auto calibration = fitting::calibrate(search->photographs, search->width, search->height, options);
    if (!calibration) return ExitCode::interrupted;
    calibration->board = search->board;
    calibration->camera.name = name_;
    for (const fitting::CalibrationPhotograph& p : calibration->photographs)
      if (!p.is_used && !p.board.corners.empty()) progress.warning(p.file + " is left out: " + p.reason);
    for (const std::string& sentence : calibration->warnings) progress.warning(sentence);
    const std::string world = place(*search, square, &calibration->camera);
    progress.finish();
    write(*calibration);
    context.out << fitting::calibration_text(*calibration) << world << "written: " << in("camera.yaml")
                << ", " << in("calibration.json") << ", " << in("calibration.svg") << '\n';
    return ExitCode::ok;
  }

 private:
  /// mm; 0 when it is not given.
  double square_of_board() const {
    if (square_.empty()) {
      if (!extrinsic_.empty())
        throw InputError("--square", "nothing",
                         "the side of a square in mm, since --extrinsic places the world");
      return 0;
    }
    double square = 0;  // a plain number is in mm
    if (!parse(std::string_view(square_), square))
      square = parse_quantity(square_, dimension::length, "--square");
    if (!(square > 0 && square < 1e6)) throw InputError("--square", square_, "a length above 0");
    return square;
  }

  /// The world at the board of --extrinsic; a sentence about it.
  std::string place(const fitting::BoardSearch& search, double square, fitting::Camera* camera) const {
    if (extrinsic_.empty()) return {};
    const cv::Mat picture = fitting::read_photograph(extrinsic_);
    if (picture.cols != camera->width || picture.rows != camera->height)
      throw InputError(
          "--extrinsic",
          extrinsic_ + " of " + std::to_string(picture.cols) + " x " + std::to_string(picture.rows) + " px",
          std::to_string(camera->width) + " x " + std::to_string(camera->height) + " px");
    const auto board = fitting::find_board(picture, search.board);
    if (!board)
      throw InputError("--extrinsic",
                       extrinsic_ + " without a board of " + to_string(search.board) + " inner corners",
                       "a photograph of the board");
    const double rms = fitting::place_at_board(*board, square, camera);
    const Vec2& origin = board->corners.front();
    return "the world is the board of " + extrinsic_ + ": its origin at pixel (" + fixed_text(origin.x(), 1) +
           ", " + fixed_text(origin.y(), 1) + "), camera " + fixed_text(camera->centre().norm(), 1) +
           " mm from it, corners off by " + short_text(rms, 3) + " px\n";
  }

  std::string in(const char* name) const { return (fs::path(output_) / name).string(); }

  void write(const fitting::Calibration& calibration) const {
    std::error_code error;
    fs::create_directories(output_, error);
    if (error || !fs::is_directory(output_))
      throw InputError("--output", "'" + output_ + "'", "a folder that can be written");
    // All texts before the first file: what fails leaves no half of the results.
    const std::string json = fitting::calibration_json(calibration),
                      svg = fitting::calibration_svg(calibration);
    write_file(in("calibration.json"), json);
    write_file(in("calibration.svg"), svg);
    fitting::write_camera(calibration.camera, in("camera.yaml"));
  }

  std::vector<std::string> files_;
  std::string board_, square_, extrinsic_, name_ = "camera", output_ = "run/calibration";
};

}  // namespace

std::unique_ptr<Verb> make_verb_calibrate() {
  return std::make_unique<Calibrate>();
}

}  // namespace rhytid::tools
