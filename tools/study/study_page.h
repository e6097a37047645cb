// Pieces of the pages and texts that studies write.
#pragma once

#include <string>
#include <vector>

#include "adjoint/parameter_space.h"
#include "sim/core/types.h"
#include "tools/report/html.h"
#include "tools/text_table.h"

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

}  // namespace rhytid::tools
