#include "sim/scene/vertex_values.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"

namespace rhytid {
namespace {

using nlohmann::json;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr int kMostVertices = 20'000'000;  // 160 MB; the largest scans have a tenth

void set(std::vector<double>& values, const std::string& vertex_text, double value,
         const std::string& where) {
  int vertex = -1;
  if (!parse(vertex_text, vertex) || vertex < 0 || vertex > kMostVertices)
    throw InputError(where, "'" + vertex_text.substr(0, 40) + "'", "a vertex number from 0");
  if (!(value > 0) || !std::isfinite(value))
    throw InputError(where, std::to_string(value) + " at vertex " + vertex_text, "a number > 0");
  if (static_cast<std::size_t>(vertex) >= values.size())
    values.resize(static_cast<std::size_t>(vertex) + 1, kNone);
  if (!std::isnan(values[static_cast<std::size_t>(vertex)]))
    throw InputError(where, "vertex " + vertex_text + " a second time", "every vertex once");
  values[static_cast<std::size_t>(vertex)] = value;
}

std::vector<double> from_csv(const std::string& text, const std::string& path) {
  std::vector<double> values;
  std::istringstream in(text);
  bool has_header = false;
  for_csv_lines(in, path, [&](const CsvLine& line) {
    const auto refuse = [&](const char* expected) {
      throw InputError(line.place, "'" + line.text.substr(0, 60) + "'", expected);
    };
    if (line.cells.size() != 2) refuse("two cells, vertex,value");
    if (has_header) {
      set(values, line.cells[0], csv_number(line.cells[1], line.place, "a number > 0"), line.place);
    } else if (line.cells[0] != "vertex") {
      refuse("a header that begins with vertex");
    }
    has_header = true;
  });
  return values;
}

std::vector<double> from_json(const std::string& text, const std::string& path) {
  const json root = json::parse(text, nullptr, false);
  std::vector<double> values;
  const auto add = [&](const std::string& vertex, const json& value) {
    if (value.is_null()) return;
    if (!value.is_number())
      throw InputError(path, "a value at vertex " + vertex + " that is no number", "a number");
    set(values, vertex, value.get<double>(), path);
  };
  if (root.is_array()) {
    for (std::size_t i = 0; i < root.size(); ++i) add(std::to_string(i), root[i]);
  } else if (root.is_object()) {
    for (const auto& [vertex, value] : root.items()) add(vertex, value);
  } else {
    throw InputError(path, "something else",
                     "a JSON list of numbers by vertex, or an object of vertex: number");
  }
  return values;
}

}  // namespace

std::vector<double> read_vertex_values(const std::string& path, const std::string& mentioned_at) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  if (stream) text << stream.rdbuf();
  if (std::filesystem::is_directory(path))
    throw InputError(mentioned_at, path + ", which is a folder", "a file");
  if (!stream || stream.bad()) throw InputError(mentioned_at, path, "a file that can be read");
  const bool is_json = path.size() > 5 && path.compare(path.size() - 5, 5, ".json") == 0;
  std::vector<double> values = is_json ? from_json(text.str(), path) : from_csv(text.str(), path);
  if (values.empty()) throw InputError(mentioned_at, path + ", which has no values", "a value per vertex");
  return values;
}

double mean_of_given(const std::vector<double>& values) {
  double sum = 0;
  int count = 0;
  for (const double value : values)
    if (!std::isnan(value)) sum += value, ++count;
  return count > 0 ? sum / count : 0;
}

VectorXd on_surface_vertices(const TriangleSurface& surface, const std::vector<double>& by_file_vertex,
                             const std::string& where) {
  // The patch's own numbers; its vertices are at most those of the file.
  std::vector<int> patch_vertex;
  for (int v = 0; v < static_cast<int>(surface.vertices.rows()); ++v) {
    const auto source = static_cast<std::size_t>(surface.source_of_vertex(v));
    if (source >= patch_vertex.size()) patch_vertex.resize(source + 1, -1);
    patch_vertex[source] = v;
  }
  VectorXd values(surface.vertices.rows());
  std::vector<int> giver(static_cast<std::size_t>(values.size()), -1);  // vertex of the file
  for (int given = 0; given < static_cast<int>(by_file_vertex.size()); ++given) {
    const double value = by_file_vertex[static_cast<std::size_t>(given)];
    // Of vertices that were joined any may have the value.
    const auto source = static_cast<std::size_t>(surface.standing_for(given));
    if (std::isnan(value) || source >= patch_vertex.size() || patch_vertex[source] < 0) continue;
    const int v = patch_vertex[source];
    int& first = giver[static_cast<std::size_t>(v)];
    if (first >= 0 && std::fabs(value - values[v]) > 1e-9 * values[v])
      throw InputError(where,
                       std::to_string(values[v]) + " at vertex " + std::to_string(first) + " and " +
                           std::to_string(value) + " at vertex " + std::to_string(given) +
                           ", which are joined",
                       "one value for both");
    if (first < 0) first = given, values[v] = value;
  }
  for (int v = 0; v < static_cast<int>(values.size()); ++v)
    if (giver[static_cast<std::size_t>(v)] < 0)
      throw InputError(where, "no value for vertex " + std::to_string(surface.source_of_vertex(v)),
                       "a value for every vertex of the patch");
  return values;
}

}  // namespace rhytid
