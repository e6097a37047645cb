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

std::string coordinate_text(const adjoint::Coordinate& coordinate, const std::string& unit) {
  switch (coordinate.transform) {
    case ParameterTransform::log:
      return "factor e";
    case ParameterTransform::logit:
      return "odds factor e";
    case ParameterTransform::none:
      break;
  }
  return short_text(coordinate.scale) + (unit.empty() ? "" : " " + unit);
}

std::string deviation_text(double deviation, const adjoint::Coordinate& coordinate, const std::string& unit) {
  constexpr double most = 3;  // a factor of 20 is as good as nothing
  if (!std::isfinite(deviation)) return "open";
  if (deviation == 0) return "held";
  if (coordinate.transform == ParameterTransform::none)
    return short_text(coordinate.scale * deviation, 2) + (unit.empty() ? "" : " " + unit);
  const std::string of = coordinate.transform == ParameterTransform::logit ? "odds " : "";
  if (deviation < 0.3) return of + short_text(100 * deviation, 2) + " %";
  return of + "factor " +
         (deviation < most ? short_text(std::exp(deviation), 2) : "> " + short_text(std::exp(most), 2));
}

}  // namespace rhytid::tools
