// Pieces of the pages and texts that studies write.
#pragma once

#include <string>
#include <vector>

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

/// A table of aligned columns for terminals: the first to the left, the others to the right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace rhytid::tools
