#include "tools/study/study_page.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "sim/output/atomic_file.h"
#include "sim/output/colour_map.h"
#include "sim/output/image.h"
#include "sim/output/text.h"

namespace rhytid::tools {

void add_pictures(HtmlPage& page, const std::string& folder, const std::vector<StudyPicture>& pictures) {
  page.begin_row();
  for (const StudyPicture& p : pictures) {
    const std::string path = folder + "/" + p.file;
    if (!std::filesystem::exists(path)) continue;
    const Image image = read_png(path);
    page.image_figure(png_uri(read_file(path)), image.width(), image.height(), p.caption, p.caption);
  }
  page.end_row();
}

HtmlTable correlation_table(const std::vector<std::string>& names, const MatrixXd& correlation,
                            const std::string& caption) {
  HtmlTable table;
  table.header = {""};
  table.header.insert(table.header.end(), names.begin(), names.end());
  table.caption = caption;
  table.wide = true;
  for (std::size_t a = 0; a < names.size(); ++a) {
    std::vector<TableCell> row = {names[a]};
    for (std::size_t b = 0; b < names.size(); ++b) {
      const double c = correlation(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      if (std::isfinite(c))
        row.emplace_back(fixed_text(c, 2), map_colour(ColourMap::diverging, 0.5 + 0.5 * c));
      else
        row.emplace_back("-");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string TextTable::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_)
    for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], row[k].size());
  std::string all;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const std::string blanks(widths[k] - row[k].size(), ' ');
      line += (k == 0 ? "" : "  ") + (k == 0 ? row[k] + blanks : blanks + row[k]);
    }
    while (!line.empty() && line.back() == ' ') line.pop_back();
    all += line + "\n";
  }
  return all;
}

}  // namespace rhytid::tools
