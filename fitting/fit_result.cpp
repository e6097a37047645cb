#include "fitting/fit_result.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "fitting/residual_table.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"

namespace rhytid::fitting {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* format_name = "rhytid fit 1";

/// A record that is read, or the same as it is written.
template <class Record, class T>
concept Writable = std::is_same_v<std::remove_const_t<Record>, T>;

// Each record lists its fields once; the same list writes and reads.
template <class Archive, Writable<FittedParameter> Record>
void fields(Archive& field, Record& p) {
  field("address", p.address);
  field("name", p.name);
  field("unit", p.unit);
  field("transform", p.transform);
  field("initial", p.initial);
  field("value", p.value);
  field("lower", p.lower);
  field("upper", p.upper);
  field("sigma", p.sigma);
  field("low95", p.low95);
  field("high95", p.high95);
  field("at_bound", p.at_bound);
  field("determined", p.determined);
  field("truth", p.truth);
}

template <class Archive, Writable<DerivedQuantity> Record>
void fields(Archive& field, Record& d) {
  field("name", d.name);
  field("unit", d.unit);
  field("value", d.value);
  field("low95", d.low95);
  field("high95", d.high95);
  field("truth", d.truth);
  field.optional("follows", d.follows);
  if (!d.follows.empty()) field("power", d.power);
}

template <class Archive, Writable<FitIteration> Record>
void fields(Archive& field, Record& i) {
  field("iteration", i.iteration);
  field("evaluations", i.evaluations);
  field("cost", i.cost);
  field("gradient_norm", i.gradient_norm);
  field("step_norm", i.step_norm);
  field("seconds", i.seconds);
  field("values", i.values);
}

template <class Archive, Writable<ResidualAxis> Record>
void fields(Archive& field, Record& a) {
  field("name", a.name);
  field("unit", a.unit);
  field("amount", a.amount);
  field("estimate", a.estimate);
  field("sigma", a.sigma);
}

template <class Archive, Writable<SystematicShift> Record>
void fields(Archive& field, Record& d) {
  field("name", d.name);
  field("change", d.change);
  field("failure", d.failure);
  field("rms_px", d.rms_px);
  field("seconds", d.seconds);
  field("shift", d.shift);
  field.optional("axes", d.axes);
  field.optional("left", d.left);
  field.optional("signature", d.signature);
  if (!d.signature.empty()) field("explained", d.explained);
}

template <class Archive, Writable<FittedStage> Record>
void fields(Archive& field, Record& s) {
  field("change", s.change);
  field("status", s.status);
  field("forward_runs", s.forward_runs);
  field("cost", s.cost);
  field("seconds", s.seconds);
  field("values", s.values);
}

template <class Archive, Writable<FurtherView> Record>
void fields(Archive& field, Record& v) {
  field("name", v.name);
  field("ratios", v.ratios);
}

template <class Archive, Writable<FittedMeasurement> Record>
void fields(Archive& field, Record& m) {
  field("clip", m.clip);
  field("frame", m.frame);
  field("quantity", m.quantity);
  field("value", m.value);
  field("sigma", m.sigma);
  field("predicted", m.predicted);
}

template <class Archive, Writable<FittedStart> Record>
void fields(Archive& field, Record& s) {
  field("initial", s.initial);
  field("screened_cost", s.screened_cost);
  field("failure", s.failure);
  field("status", s.status);
  field("final_cost", s.final_cost);
  field("values", s.values);
  field("forward_runs", s.forward_runs);
  field("optimum", s.optimum);
  field("evaluations", s.evaluations);
  field("costs", s.costs);
}

template <class Archive, Writable<ProfilePoint> Record>
void fields(Archive& field, Record& p) {
  field("value", p.value);
  field("cost", p.cost);
  field("deviance", p.deviance);
  field("status", p.status);
  field("forward_runs", p.forward_runs);
  field("values", p.values);
}

template <class Archive, Writable<ParameterProfile> Record>
void fields(Archive& field, Record& p) {
  field("address", p.address);
  field("low95", p.low95);
  field("high95", p.high95);
  field("bounded_below", p.bounded_below);
  field("bounded_above", p.bounded_above);
  field("linear_low95", p.linear_low95);
  field("linear_high95", p.linear_high95);
  field("sigma", p.sigma);
  field("widening", p.widening);
  field("quantile", p.quantile);
  field("forward_runs", p.forward_runs);
  field("warning", p.warning);
  field("points", p.points);
}

template <class Archive, Writable<FittedView> Record>
void fields(Archive& field, Record& v) {
  field("camera", v.camera);
  field("num_tracks", v.num_tracks);
  field("num_observations", v.num_observations);
  field("rms_px", v.rms_px);
  field("footage_file", v.footage_file);
  field("tracks_file", v.tracks_file);
  field("camera_file", v.camera_file);
}

template <class Archive, Writable<FittedClip> Record>
void fields(Archive& field, Record& c) {
  field("name", c.name);
  field("num_tracks", c.num_tracks);
  field("tracks_left_out", c.tracks_left_out);
  field("num_observations", c.num_observations);
  field("frames", c.frames);
  field("rms_px", c.rms_px);
  field("cost", c.cost);
  field("reduced_chi_square", c.reduced_chi_square);
  field("degrees_of_freedom", c.degrees_of_freedom);
  field("views", c.views);
  field("scene_file", c.scene_file);
  field("fitted_scene_file", c.fitted_scene_file);
}

template <class Archive, Writable<FitResult> Record>
void fields(Archive& field, Record& r) {
  field("case_name", r.case_name);
  field("case_file", r.case_file);
  field("optimiser", r.optimiser);
  field("status", r.status);
  field("converged", r.converged);
  field("parameters", r.parameters);
  field("derived", r.derived);
  field("gauge", r.gauge);
  field("cannot_tell", r.cannot_tell);
  field.optional("misfit", r.misfit);
  field("initial_cost", r.initial_cost);
  field("final_cost", r.final_cost);
  field("num_observations", r.num_observations);
  field("num_tracks", r.num_tracks);
  field("tracks_left_out", r.tracks_left_out);
  field("frames", r.frames);
  field("rms_px", r.rms_px);
  field("reduced_chi_square", r.reduced_chi_square);
  field("forward_runs", r.forward_runs);
  field("jacobian_runs", r.jacobian_runs);
  field("seconds", r.seconds);
  field("forward_seconds", r.forward_seconds);
  field("history", r.history);
  field.optional("systematic", r.systematic);
  field.optional("stages", r.stages);
  field.optional("further_views", r.further_views);
  field.optional("measured", r.measured);
  field.optional("profiles", r.profiles);
  field.optional("starts", r.starts);
  field("singular_values", r.singular_values);
  field("right_vectors", r.right_vectors);
  field("correlation", r.correlation);
  field("notes", r.notes);
  field("scene_file", r.scene_file);
  field("footage_file", r.footage_file);
  field("tracks_file", r.tracks_file);
  field("camera_file", r.camera_file);
  field("settings", r.settings);
  field("fitted_scene_file", r.fitted_scene_file);
  field.optional("clips", r.clips);
}

/// JSON has no NaN and no infinity: null and the words "inf", "-inf" stand for them.
Json number(double value) {
  if (std::isnan(value)) return nullptr;
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  return value;
}

class Writer {
 public:
  Json out = Json::object();

  template <class T>
  void operator()(const char* key, const T& value) {
    out[key] = json(value);
  }
  /// A list or a text that files without it leave empty.
  template <class T>
  void optional(const char* key, const T& list) {
    if (!list.empty()) out[key] = json(list);
  }

 private:
  static Json json(const std::string& v) { return v; }
  static Json json(bool v) { return v; }
  static Json json(int v) { return v; }
  static Json json(double v) { return number(v); }
  /// A missing truth is absent, unlike a truth that is not a number.
  static Json json(const std::optional<double>& v) { return v ? number(*v) : Json("unknown"); }
  static Json json(const VectorXd& v) { return json(std::vector<double>(v.begin(), v.end())); }
  static Json json(const MatrixXd& m) {
    Json rows = Json::array();
    for (Eigen::Index i = 0; i < m.rows(); ++i) rows.push_back(json(VectorXd(m.row(i).transpose())));
    return rows;
  }
  template <class Record>
  static Json json(const Record& v) {
    Writer w;
    fields(w, v);
    return std::move(w.out);
  }
  template <class T>
  static Json json(const std::vector<T>& v) {
    Json list = Json::array();
    for (const T& item : v) list.push_back(json(item));
    return list;
  }
};

class Reader {
 public:
  Reader(const Json& in, std::string where) : in_(in), where_(std::move(where)) {
    if (!in.is_object()) throw InputError(where_, in.dump(), "an object");
  }

  template <class T>
  void operator()(const char* key, T& value) {
    const std::string where = where_ + "/" + key;
    const auto found = in_.find(key);
    if (found == in_.end()) throw InputError(where, "nothing", "a value");
    read(*found, value, where);
  }
  template <class T>
  void optional(const char* key, T& list) {
    list.clear();
    if (const auto found = in_.find(key); found != in_.end()) read(*found, list, where_ + "/" + key);
  }

 private:
  static void read(const Json& j, std::string& v, const std::string& where) {
    if (!j.is_string()) throw InputError(where, j.dump(), "a text");
    v = j.get<std::string>();
  }
  static void read(const Json& j, bool& v, const std::string& where) {
    if (!j.is_boolean()) throw InputError(where, j.dump(), "true or false");
    v = j.get<bool>();
  }
  static void read(const Json& j, int& v, const std::string& where) {
    const bool fits = j.is_number_integer() && j.get<double>() == static_cast<int>(j.get<double>());
    if (!fits) throw InputError(where, j.dump(), "a whole number");
    v = j.get<int>();
  }
  static void read(const Json& j, double& v, const std::string& where) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (j.is_null()) {
      v = std::numeric_limits<double>::quiet_NaN();
    } else if (j == "inf" || j == "-inf") {
      v = j == "inf" ? infinity : -infinity;
    } else if (j.is_number()) {
      v = j.get<double>();
    } else {
      throw InputError(where, j.dump(), "a number, null, \"inf\" or \"-inf\"");
    }
  }
  static void read(const Json& j, std::optional<double>& v, const std::string& where) {
    v.reset();
    if (j == "unknown") return;
    double value = 0;
    read(j, value, where);
    v = value;
  }
  static void read(const Json& j, VectorXd& v, const std::string& where) {
    std::vector<double> values;
    read(j, values, where);
    v = Eigen::Map<const VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  static void read(const Json& j, MatrixXd& m, const std::string& where) {
    std::vector<VectorXd> rows;
    read(j, rows, where);
    m.resize(static_cast<Eigen::Index>(rows.size()), rows.empty() ? 0 : rows.front().size());
    for (size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].size() != m.cols()) {
        throw InputError(where + "/" + std::to_string(i), std::to_string(rows[i].size()) + " numbers",
                         std::to_string(m.cols()));
      }
      m.row(static_cast<Eigen::Index>(i)) = rows[i].transpose();
    }
  }
  template <class Record>
  static void read(const Json& j, Record& v, const std::string& where) {
    Reader r(j, where);
    fields(r, v);
  }
  template <class T>
  static void read(const Json& j, std::vector<T>& v, const std::string& where) {
    if (!j.is_array()) throw InputError(where, j.dump(), "a list");
    v.assign(j.size(), T());
    for (size_t i = 0; i < j.size(); ++i) read(j[i], v[i], where + "/" + std::to_string(i));
  }

  const Json& in_;
  std::string where_;
};

/// Tables by parameter are empty (the fit ended before them) or fit the number of parameters.
void check_sizes(const FitResult& result, const std::string& where) {
  const auto n = static_cast<Eigen::Index>(result.parameters.size());
  const auto check = [&](const char* key, Eigen::Index rows, Eigen::Index columns, Eigen::Index want) {
    if ((rows == 0 && columns == 0) || (rows == n && columns == want)) return;
    throw InputError(where + "/" + key, std::to_string(rows) + " × " + std::to_string(columns) + " numbers",
                     std::to_string(n) + " × " + std::to_string(want) + " for as many parameters");
  };
  check("right_vectors", result.right_vectors.rows(), result.right_vectors.cols(), n);
  check("correlation", result.correlation.rows(), result.correlation.cols(), n);
  if (result.singular_values.size() > 0) check("singular_values", result.singular_values.size(), 1, 1);
  for (size_t i = 0; i < result.further_views.size(); ++i)
    check(("further_views/" + std::to_string(i) + "/ratios").c_str(),
          static_cast<Eigen::Index>(result.further_views[i].ratios.size()), 1, 1);
  for (size_t i = 0; i < result.systematic.size(); ++i) {
    const auto size = static_cast<Eigen::Index>(result.systematic[i].shift.size());
    if (size > 0) check(("systematic/" + std::to_string(i) + "/shift").c_str(), size, 1, 1);
  }
  for (size_t i = 0; i < result.starts.size(); ++i) {
    const FittedStart& start = result.starts[i];
    const std::string at = "starts/" + std::to_string(i);
    for (const std::vector<double>* values : {&start.initial, &start.values})
      if (!values->empty()) check(at.c_str(), static_cast<Eigen::Index>(values->size()), 1, 1);
    if (start.evaluations.size() != start.costs.size())
      throw InputError(where + "/" + at, "other numbers of evaluations and costs", "one cost for each");
  }
  for (size_t i = 0; i < result.profiles.size(); ++i)
    for (const ProfilePoint& point : result.profiles[i].points)
      check(("profiles/" + std::to_string(i) + "/points").c_str(),
            static_cast<Eigen::Index>(point.values.size()), 1, 1);
  for (size_t i = 0; i < result.history.size(); ++i) {
    const auto size = static_cast<Eigen::Index>(result.history[i].values.size());
    if (size > 0) check(("history/" + std::to_string(i) + "/values").c_str(), size, 1, 1);
  }
}

}  // namespace

std::vector<const SystematicShift*> counted_shifts(const std::vector<SystematicShift>& shifts) {
  if (!shifts.empty() && shifts.back().name == kTogether) return {&shifts.back()};
  std::vector<const SystematicShift*> counted;
  for (const SystematicShift& shift : shifts)
    if (shift.failure.empty()) counted.push_back(&shift);
  return counted;
}

std::vector<DerivedProfile> derived_profiles(const FitResult& result, const ParameterProfile& profile) {
  std::vector<DerivedProfile> found;
  for (const FittedParameter& p : result.parameters)
    for (const DerivedQuantity& d : result.derived) {
      if (p.address != profile.address || d.follows != p.address || !(p.value > 0)) continue;
      const auto at = [&](double value) { return d.value * std::pow(value / p.value, d.power); };
      DerivedProfile& out = found.emplace_back(DerivedProfile{
          d.name, d.unit, d.value, at(profile.low95), at(profile.high95), at(profile.linear_low95),
          at(profile.linear_high95), profile.bounded_below, profile.bounded_above});
      if (d.power > 0) continue;
      std::swap(out.low95, out.high95);
      std::swap(out.linear_low95, out.linear_high95);
      std::swap(out.bounded_below, out.bounded_above);
    }
  return found;
}

std::string FitResult::address_in_clip(const FittedParameter& parameter, int clip) const {
  const std::string& address = parameter.address;
  if (address.find("/path/offset/") != std::string::npos) return {};  // it moves many (path_deviations.h)
  const std::string prefix = "/clips/";
  if (!address.starts_with(prefix)) return address;
  const std::size_t end = std::min(address.find('/', prefix.size()), address.size());
  const bool is_own = clips.empty() || clips[static_cast<std::size_t>(clip)].name ==
                                           address.substr(prefix.size(), end - prefix.size());
  return is_own ? address.substr(end) : std::string();
}

void write_fit_result(const FitResult& result, const std::string& folder) {
  Writer writer;
  writer("format", std::string(format_name));
  fields(writer, result);
  writer("num_residuals", static_cast<int>(result.residuals.size()));
  // fit.json comes last: where it is, the others are complete.
  if (result.fitted_scene)
    write_file(folder + "/" + result.fitted_scene_file, scene_to_json(*result.fitted_scene).dump(1) + "\n");
  if (result.fitted_scenes.size() > 1)
    for (size_t c = 0; c < result.clips.size(); ++c) {
      const std::filesystem::path path = std::filesystem::path(folder) / result.clips[c].fitted_scene_file;
      std::error_code ignored;  // write_file says when there is no folder
      std::filesystem::create_directories(path.parent_path(), ignored);
      write_file(path.string(), scene_to_json(result.fitted_scenes[c]).dump(1) + "\n");
    }
  write_file(folder + "/residuals.csv", residual_text(result));
  write_file(folder + "/fit.json", writer.out.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

FitResult read_fit_result(const std::string& folder) {
  const std::string path = folder + "/fit.json";
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    throw InputError(folder,
                     std::filesystem::is_directory(folder, error) ? "no fit.json in it" : "no folder there",
                     "the folder with the results of a fit (`rhytid fit CASE -o FOLDER`)");
  Json json;
  try {
    json = Json::parse(read_file(path));
  } catch (const Json::exception& e) {
    throw InputError(path + ": not readable as JSON: " + e.what());
  }
  FitResult result;
  Reader reader(json, path + ":");
  std::string format;
  reader("format", format);
  if (format != format_name) throw InputError(path + ":/format", format, format_name);
  fields(reader, result);
  check_sizes(result, path + ":");
  const std::string csv = folder + "/residuals.csv";
  result.residuals = parse_residuals(read_file(csv), csv, result);
  int num_residuals = 0;
  reader("num_residuals", num_residuals);
  if (num_residuals != static_cast<int>(result.residuals.size())) {
    throw InputError(csv, std::to_string(result.residuals.size()) + " rows",
                     std::to_string(num_residuals) + ", as fit.json of the same fit says");
  }
  return result;
}

}  // namespace rhytid::fitting
