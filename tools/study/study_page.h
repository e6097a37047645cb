// Pieces of the pages and texts that studies write.
#pragma once

#include <string>
#include <vector>

#include "adjoint/parameter_space.h"
#include "sim/core/types.h"
#include "tools/report/html.h"

namespace rhytid::tools {

/// A PNG of a study's folder and what it shows.
struct StudyPicture {
  std::string file, caption;
};

/// Those that exist, beside each other.
void add_pictures(HtmlPage& page, const std::string& folder, const std::vector<StudyPicture>& pictures);

/// Pairs of names, coloured by the correlation; NaN is shown as -.
HtmlTable correlation_table(const std::vector<std::string>& names, const MatrixXd& correlation,
                            const std::string& caption);

/// What a unit of a coordinate is: "factor e", "odds factor e" or "5 mm"; `unit` is the parameter's.
std::string coordinate_text(const adjoint::Coordinate& coordinate, const std::string& unit);
/// A deviation of a coordinate as people read it: "3 %", "factor 2.1", "odds 3 %", "0.2 mm"; "open" when it is
/// not finite and "held" when it is zero.
std::string deviation_text(double deviation, const adjoint::Coordinate& coordinate, const std::string& unit);

/// A table of aligned columns for terminals: the first to the left, the others to the right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string text() const;  ///< widths in characters of UTF-8

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace rhytid::tools
