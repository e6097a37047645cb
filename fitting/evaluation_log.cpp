#include "fitting/evaluation_log.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* log_format = "rhytid evaluations 1";
constexpr const char* record_format = "rhytid evaluation 1";

const char* name_of(EvaluationLog::Kind kind) {
  switch (kind) {
    case EvaluationLog::Kind::run:
      return "run";
    case EvaluationLog::Kind::tangent:
      return "tangent";
    case EvaluationLog::Kind::points:
      return "points";
    case EvaluationLog::Kind::adjoint:
      break;
  }
  return "adjoint";
}

std::string bytes(const double* values, Eigen::Index count) {
  return {reinterpret_cast<const char*>(values), static_cast<std::size_t>(count) * sizeof(double)};
}

ordered_json identity_json(const FitIdentity& identity) {
  ordered_json parts = ordered_json::object();
  for (const auto& [part, digest] : identity) parts[part] = digest;
  return {{"format", log_format}, {"parts", parts}};
}

/// "other tracks and scene" where the log differs; empty when it is of the same fit.
std::string difference(const ordered_json& found, const FitIdentity& identity) {
  if (!found.is_object() || found.value("format", "") != log_format || !found.contains("parts"))
    return "an unknown format";
  std::string parts;
  for (const auto& [part, digest] : identity)
    if (!found["parts"].is_object() || found["parts"].value(part, "") != digest)
      parts += (parts.empty() ? "other " : ", ") + part;
  return parts;
}

struct Header {
  EvaluationLog::Record record;  ///< without its values
  std::string kind;
  Eigen::Index parameters = 0, rows = 0, columns = 0;
  std::size_t data = 0;  ///< where the doubles begin
};

/// Nothing when the content is not whole.
std::optional<Header> read_header(const std::string& content) {
  const std::size_t end = content.find('\n');
  if (end == std::string::npos) return std::nullopt;
  try {
    const auto json = ordered_json::parse(content.substr(0, end));
    if (json.at("format") != record_format) return std::nullopt;
    Header h;
    h.kind = json.at("kind").get<std::string>();
    h.record.failure = json.at("failure").get<std::string>();
    h.record.seconds = json.at("seconds").get<double>();
    h.parameters = json.at("parameters").get<Eigen::Index>();
    h.rows = json.at("rows").get<Eigen::Index>();
    h.columns = json.at("columns").get<Eigen::Index>();
    h.data = end + 1;
    const auto limit = static_cast<Eigen::Index>(content.size());  // products below cannot then wrap around
    const auto sane = [limit](Eigen::Index n) { return n >= 0 && n <= limit; };
    if (!sane(h.parameters) || !sane(h.rows) || !sane(h.columns)) return std::nullopt;
    const auto wanted = (static_cast<std::size_t>(h.parameters) +
                         static_cast<std::size_t>(h.rows) * static_cast<std::size_t>(h.columns)) *
                        sizeof(double);
    if (content.size() - h.data != wanted) return std::nullopt;
    return h;
  } catch (const ordered_json::exception&) {
    return std::nullopt;
  }
}

}  // namespace

EvaluationLog::EvaluationLog(std::string folder, const FitIdentity& identity, bool anew)
    : folder_(std::move(folder)) {
  const fs::path mark = fs::path(folder_) / "identity.json";
  std::error_code error;
  if (fs::exists(folder_, error)) {
    const auto found = fs::exists(mark, error) ? ordered_json::parse(read_file(mark.string()), nullptr, false)
                                               : ordered_json();
    const std::string reason = anew ? "not wanted" : difference(found, identity);
    if (!reason.empty()) move_old(reason);
  }
  if (!anew && !fs::exists(folder_, error)) take_back(identity);
  fs::create_directories(folder_, error);
  if (error || !fs::is_directory(folder_))
    throw InputError(folder_, "no folder (" + error.message() + ")", "a folder that can be written");
  if (!fs::exists(mark, error)) write_file(mark.string(), identity_json(identity).dump(1) + "\n");
  read_index();
}

void EvaluationLog::move_old(const std::string& reason) {
  std::error_code error;
  std::string old = folder_ + ".old";
  for (int k = 2; fs::exists(old, error); ++k) old = folder_ + ".old" + std::to_string(k);
  fs::rename(folder_, old, error);
  if (error)
    throw InputError(folder_, "a log of another fit that cannot be moved (" + error.message() + ")",
                     "a folder that can be written");
  set_aside_ = "evaluations of an earlier fit (" + reason + ") are set aside in " + old;
}

void EvaluationLog::take_back(const FitIdentity& identity) {
  fs::path path = fs::path(folder_).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  const fs::path parent = path.has_parent_path() ? path.parent_path() : ".";
  const std::string prefix = path.filename().string() + ".old";
  std::vector<fs::path> candidates;
  std::error_code error;
  for (fs::directory_iterator entry(parent, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(prefix) && name.find_first_not_of("0123456789", prefix.size()) == std::string::npos)
      candidates.push_back(entry->path());
  }
  // Of several the one that was used last.
  std::sort(candidates.begin(), candidates.end(), [](const fs::path& a, const fs::path& b) {
    std::error_code ignored;
    return fs::last_write_time(a, ignored) > fs::last_write_time(b, ignored);
  });
  for (const fs::path& old : candidates) {
    const fs::path mark = old / "identity.json";
    std::error_code absent;
    if (!fs::is_regular_file(mark, absent)) continue;
    if (!difference(ordered_json::parse(read_file(mark.string()), nullptr, false), identity).empty())
      continue;
    fs::rename(old, path, absent);
    if (absent) continue;
    set_aside_ += (set_aside_.empty() ? "" : "; ") + std::string("those of this fit are taken back from ") +
                  old.string();
    return;
  }
}

void EvaluationLog::read_index() {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(folder_))
    if (entry.path().extension() == ".bin") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());  // of two records at the same values the later one counts
  for (const fs::path& file : paths) {
    const std::string path = file.string(), content = read_file(path), stem = file.stem().string();
    int number = 0;
    std::sscanf(stem.c_str() + stem.find('-') + 1, "%d", &number);
    last_number_ = std::max(last_number_, number);
    const std::optional<Header> header = read_header(content);
    if (!header) continue;
    const std::string t = content.substr(header->data, header->parameters * sizeof(double));
    for (const Kind kind : {Kind::run, Kind::tangent, Kind::adjoint, Kind::points})
      if (header->kind == name_of(kind)) files_[{kind, t}] = path;
    num_runs_ += header->kind == name_of(Kind::run) ? 1 : 0;
  }
}

std::optional<EvaluationLog::Record> EvaluationLog::find(Kind kind, const VectorXd& t) const {
  const auto found = files_.find({kind, bytes(t.data(), t.size())});
  if (found == files_.end()) return std::nullopt;
  std::error_code error;
  if (!fs::exists(found->second, error)) return std::nullopt;
  const std::string content = read_file(found->second);
  std::optional<Header> header = read_header(content);
  // The file is asked again what it holds: another process may have written over it.
  if (!header || header->kind != name_of(kind) || header->parameters != t.size() ||
      content.compare(header->data, found->first.second.size(), found->first.second) != 0)
    return std::nullopt;
  Record record = std::move(header->record);
  record.values.resize(header->rows, header->columns);
  if (record.values.size() > 0)
    std::memcpy(record.values.data(), content.data() + header->data + t.size() * sizeof(double),
                record.values.size() * sizeof(double));
  return record;
}

void EvaluationLog::add(Kind kind, const VectorXd& t, const Record& record) {
  if (!is_writable_) return;
  const ordered_json header = {{"format", record_format},         {"kind", name_of(kind)},
                               {"parameters", t.size()},          {"rows", record.values.rows()},
                               {"columns", record.values.cols()}, {"failure", record.failure},
                               {"seconds", record.seconds}};
  char name[48];
  std::snprintf(name, sizeof(name), "%s-%04d.bin", name_of(kind), ++last_number_);
  const std::string path = (fs::path(folder_) / name).string(), key = bytes(t.data(), t.size());
  try {
    write_file(path, header.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n" + key +
                         bytes(record.values.data(), record.values.size()));
    files_[{kind, key}] = path;
  } catch (const InputError& error) {
    is_writable_ = false;
    if (warn) warn(std::string("this fit cannot be resumed from here on: ") + error.what());
  }
}

}  // namespace rhytid::fitting
