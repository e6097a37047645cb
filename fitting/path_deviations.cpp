#include "fitting/path_deviations.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/scene/located_json.h"

namespace rhytid::fitting {
namespace {

/// Deviations below this count as none, mm: no run of a simulation is that exact.
constexpr double kLeastSigma = 1e-7;
/// Bounds of a fitted offset, in its own deviations.
constexpr double kReach = 8;

constexpr std::array<std::pair<int, int>, 6> kPairs{{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};

/// Columns of a symmetric matrix, "own_xx" to "own_zz".
std::vector<std::string> columns_of(const std::string& prefix) {
  std::vector<std::string> names;
  for (const auto& [a, b] : kPairs) names.push_back(prefix + "_" + "xyz"[a] + "xyz"[b]);
  return names;
}

/// Where the columns are in the header; empty when there are none of them. Throws InputError for a part of them.
std::vector<std::size_t> find_columns(const CsvLine& header, const std::vector<std::string>& names) {
  std::vector<std::size_t> at;
  for (const std::string& name : names) {
    const auto found = std::find_if(header.cells.begin(), header.cells.end(), [&](const std::string& cell) {
      return cell == name || cell == name + "_mm" || cell == name + "_mm2";
    });
    if (found != header.cells.end()) at.push_back(static_cast<std::size_t>(found - header.cells.begin()));
  }
  if (!at.empty() && at.size() != names.size())
    throw InputError(header.place, "only some of the columns " + names.front() + " to " + names.back(),
                     "all " + std::to_string(names.size()) + " of them, or none");
  return at;
}

Mat3 covariance_in(const CsvLine& line, const std::vector<std::size_t>& columns, const std::string& what) {
  Mat3 covariance = Mat3::Zero();
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto [a, b] = kPairs[k];
    covariance(a, b) = covariance(b, a) = csv_number(line.cells[columns[k]], line.place);
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(covariance, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues()[0] < -1e-6 * std::fabs(eigen.eigenvalues()[2]) - 1e-12)
    throw InputError(line.place, what + " columns that are no covariance",
                     "a matrix without negative variances");
  return covariance;
}

Mat3 squares_in(const CsvLine& line, const std::vector<std::size_t>& columns) {
  Vec3 sigma;
  for (int a = 0; a < 3; ++a) {
    sigma[a] = csv_number(line.cells[columns[static_cast<std::size_t>(a)]], line.place);
    if (sigma[a] < 0)
      throw InputError(line.place, std::to_string(sigma[a]) + " mm", "a deviation that is not negative");
  }
  return sigma.cwiseAbs2().asDiagonal();
}

/// √λ v of the axes along which a place may be off.
std::vector<Vec3> axes_of(const Mat3& covariance) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(covariance);
  std::vector<Vec3> axes;
  for (int a = 2; a >= 0; --a)
    if (eigen.eigenvalues()[a] > kLeastSigma * kLeastSigma)
      axes.emplace_back(std::sqrt(eigen.eigenvalues()[a]) * eigen.eigenvectors().col(a));
  return axes;
}

double largest_sigma(const Mat3& covariance) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()[2]));
}

std::string two_digits(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", x);
  return text;
}

/// Knots that a run of so many frames can see: a spline looks beyond its next knot, hardly beyond the one after.
std::size_t knots_seen(const ColliderScene& collider, const TimeScene& time, int last_frame) {
  const double end = last_frame / time.frame_rate + time.offset;
  std::size_t count = 0;
  while (count < collider.path.size() && collider.path[count].time < end) ++count;
  count += collider.interpolation == PathKind::linear ? 1 : 2;
  return std::min(count, collider.path.size());
}

/// As the scene's parameters have it.
std::string path_address(const ColliderScene& collider) {
  return "/colliders/" + escape_key(collider.name) + "/path";
}

/// All modes of one collider's path, of `clip`.
class PathModes {
 public:
  PathModes(const ColliderScene& collider, std::string clip, std::size_t knots, const PathDeviations& known)
      : collider_(collider), clip_(std::move(clip)) {
    for (const Vec3& axis : axes_of(known.shared)) add_shared(axis);
    for (std::size_t k = 0; k < std::min(knots, known.own.size()); ++k)
      for (const Vec3& axis : axes_of(known.own[k])) {
        FitParameter& p = parameter("knot_error/" + std::to_string(own.size()), own);
        p.group = group() + " by knot";
        add(axis, k, p);
      }
  }
  std::vector<FitParameter> shared, own;

  std::string group() const { return collider_.name + " path" + (clip_.empty() ? "" : " (" + clip_ + ")"); }

 private:
  void add_shared(Vec3 axis) {
    FitParameter& p = parameter("offset/" + std::to_string(shared.size()), shared);
    Eigen::Index along = 0;
    axis.cwiseAbs().maxCoeff(&along);
    if (axis[along] < 0) axis = -axis;
    const bool is_along = std::fabs(axis[along]) > 0.999 * axis.norm();
    p.group = group() + " offset";
    p.name = collider_.name + " path offset " + std::to_string(shared.size()) + " (" +
             two_digits(axis.norm()) + " mm, " + (is_along ? "" : "mostly ") + "xyz"[along] + ")";
    for (std::size_t k = 0; k < collider_.path.size(); ++k) add(axis, k, p);
  }
  FitParameter& parameter(const std::string& what, std::vector<FitParameter>& list) const {
    FitParameter& p = list.emplace_back();
    p.address = path_address(collider_) + "/" + what;
    p.name = collider_.name + " path " + what;
    p.clip = clip_;
    p.initial = 0, p.lower = -kReach, p.upper = kReach, p.transform = ParameterTransform::none;
    p.prior_sigma = 1;
    return p;
  }
  void add(const Vec3& axis, std::size_t knot, FitParameter& p) const {
    for (int a = 0; a < 3; ++a)
      if (axis[a] != 0)
        p.moves.emplace_back(
            path_address(collider_) + "/" + std::to_string(knot) + "/position/" + std::to_string(a), axis[a]);
  }

  const ColliderScene& collider_;
  std::string clip_;
};

/// Paths that are parameters of the scene: the files of colliders that `input.path_errors` or fitted offsets move.
void release(const std::vector<FitParameter>& modes, const std::string& clip, Scene& scene) {
  for (ColliderScene& collider : scene.colliders)
    for (const FitParameter& p : modes)
      if (!p.moves.empty() && (p.clip.empty() || p.clip == clip) &&
          p.address.starts_with(path_address(collider) + "/"))
        collider.path_file.clear();
}

}  // namespace

std::optional<PathDeviations> read_path_deviations(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file, "a file that cannot be read", "a readable path (CSV)");
  PathDeviations found;
  std::vector<std::size_t> own, shared, sigma;
  bool has_header = false;
  for_csv_lines(in, file, [&](const CsvLine& line) {
    if (!has_header) {
      has_header = true;
      own = find_columns(line, columns_of("own"));
      shared = find_columns(line, columns_of("shared"));
      sigma = find_columns(line, {"sigma_x", "sigma_y", "sigma_z"});
      if (!own.empty() && !sigma.empty())
        throw InputError(line.place, "columns own_.. and sigma_..", "one of the two");
      return;
    }
    if (own.empty() && shared.empty() && sigma.empty()) return;
    found.own.push_back(!sigma.empty() ? squares_in(line, sigma) : covariance_in(line, own, "own_.."));
    found.shared += covariance_in(line, shared, "shared_..");
  });
  if (found.own.empty()) return std::nullopt;
  found.shared /= static_cast<double>(found.own.size());
  return found;
}

namespace {

/// What is known of a path, and in words who says so.
struct KnownPath {
  PathDeviations deviations;
  std::string source;
};

/// Whether the fit has knots of the path among its parameters, in that direction.
bool fits_knots(const JointFitInput& input, const std::string& clip, const ColliderScene& collider,
                int axis) {
  const std::string path = path_address(collider) + "/", end = "/position/" + std::to_string(axis);
  return std::any_of(
      input.options.parameters.begin(), input.options.parameters.end(), [&](const FitParameter& p) {
        return (p.clip.empty() || p.clip == clip) && p.address.starts_with(path) && p.address.ends_with(end);
      });
}

PathDeviations alike(double sigma) {
  return {.shared = sigma * sigma * Mat3::Identity(), .own = {}};
}

/// What the case says of a path, of this clip before what it says of all.
const ConsideredQuantity* path_of_case(const FitCase& fit, const std::string& clip,
                                       const ColliderScene& collider) {
  const ConsideredQuantity* found = nullptr;
  for (const ConsideredQuantity& q : fit.consider_paths)
    if (q.address == path_address(collider) && (q.clip == clip || (q.clip.empty() && found == nullptr)))
      found = &q;
  return fit.consider ? found : nullptr;
}

/// By the case, by its file, by default. Nothing: it is taken for exact.
std::optional<KnownPath> known_path(const JointFitInput& input, const std::string& clip,
                                    const ColliderScene& collider) {
  if (const ConsideredQuantity* q = path_of_case(input.options, clip, collider)) {
    if (!(q->sigma > 0)) return std::nullopt;
    return KnownPath{alike(q->sigma), "as the case says (/fit/consider)"};
  }
  if (!collider.path_file.empty())
    if (const auto stated = read_path_deviations(collider.path_file)) {
      if (stated->own.size() != collider.path.size())  // the file has changed since the scene was read
        throw InputError(collider.path_file, std::to_string(stated->own.size()) + " knots",
                         std::to_string(collider.path.size()) + " as the scene has");
      return KnownPath{*stated, ""};
    }
  if (input.options.consider) return std::nullopt;
  KnownPath known{alike(kPathSigma), "by default, since nothing states its deviations"};
  for (int a = 0; a < 3; ++a)
    if (fits_knots(input, clip, collider, a)) known.deviations.shared(a, a) = 0;
  if (known.deviations.shared.isZero(0)) return std::nullopt;
  return known;
}

/// "0.015 mm for all knots alike and to 0.002 mm for each by itself (the largest deviations in any direction)".
std::string in_words(const KnownPath& known) {
  std::string text = two_digits(largest_sigma(known.deviations.shared)) + " mm for all knots alike";
  double own = 0;
  for (const Mat3& of_knot : known.deviations.own) own = std::max(own, largest_sigma(of_knot));
  if (!known.deviations.own.empty())
    text += " and to " + two_digits(own) + " mm for each by itself (the largest deviations in any direction)";
  else
    text += " in each direction";
  return text + (known.source.empty() ? "" : ", " + known.source);
}

}  // namespace

JointFitInput with_path_errors(const JointFitInput& input) {
  JointFitInput out = input;
  const std::string& use = input.options.path_deviations;
  if (use != "consider" && use != "fit" && use != "ignore")
    throw InputError("fit: path_deviations", "'" + use + "'", "consider, fit or ignore");
  std::vector<FitParameter> fitted;
  for (const FitClip& clip : input.clips) {
    const std::string of_clip = input.clips.size() > 1 ? clip.name : "";
    const int last = input.options.last_frame > 0 ? std::min(input.options.last_frame, clip.scene.time.frames)
                                                  : clip.scene.time.frames;
    for (const ColliderScene& collider : clip.scene.colliders) {
      if (collider.path.empty()) continue;
      const std::string file = std::filesystem::path(collider.path_file).filename().string();
      const std::string which = "The path of " + collider.name +
                                (of_clip.empty() ? "" : " in clip " + of_clip) +
                                (file.empty() ? "" : " (" + file + ")");
      const std::optional<KnownPath> known = known_path(input, clip.name, collider);
      if (!known) {
        if (!file.empty()) out.path_notes.push_back(which + " states no deviations: it is taken for exact.");
        continue;
      }
      const std::string size = " is known to " + in_words(*known) + ": ";
      if (use == "ignore") {
        out.path_notes.push_back(which + size + "not used, as the case asks (/fit/path_deviations).");
        continue;
      }
      PathModes modes(collider, of_clip, knots_seen(collider, clip.scene.time, last), known->deviations);
      const bool fits_here = use == "fit" && !modes.shared.empty();
      out.path_notes.push_back(which + size +
                               (fits_here ? "the offset is fitted with that as its prior, what knots err by "
                                            "themselves is considered."
                                          : "what the residuals leave of that is considered."));
      auto& of_shared = fits_here ? fitted : out.path_errors;
      of_shared.insert(of_shared.end(), modes.shared.begin(), modes.shared.end());
      out.path_errors.insert(out.path_errors.end(), modes.own.begin(), modes.own.end());
    }
  }
  if (fitted.empty()) return out;
  for (std::size_t c = 0; c < out.clips.size(); ++c) {
    const std::string of_clip = out.clips.size() > 1 ? out.clips[c].name : "";
    release(fitted, of_clip, out.clips[c].scene);
    for (std::vector<Scene>& stage : out.stages) release(fitted, of_clip, stage[c]);
  }
  for (FitParameter& p : fitted) {
    p.group.clear();
    out.options.parameters.push_back(std::move(p));
  }
  return out;
}

void add_path_notes(const JointFitInput& input, FitResult& result) {
  std::string in, out;
  for (std::size_t k = 0; k < input.path_errors.size(); ++k) {
    const std::string& group = input.path_errors[k].group;
    if (k > 0 && input.path_errors[k - 1].group == group) continue;
    const auto found =
        std::find_if(result.systematic.begin(), result.systematic.end(),
                     [&](const SystematicShift& shift) { return shift.name == "held " + group; });
    if (found != result.systematic.end() && found->failure.empty())
      in += (in.empty() ? "" : ", ") + group;
    else
      out += (out.empty() ? "" : "; ") + group +
             (found == result.systematic.end() ? std::string() : " (" + found->failure + ")");
  }
  if (!in.empty())
    result.notes.push_back("What these may be off would move is in the intervals: " + in + ".");
  if (!out.empty())
    result.notes.push_back("Warning: what these may be off would move is not in the intervals: " + out + ".");
}

void release_paths(JointFitInput& input) {
  for (FitClip& clip : input.clips)
    release(input.path_errors, input.clips.size() > 1 ? clip.name : "", clip.scene);
}

}  // namespace rhytid::fitting
