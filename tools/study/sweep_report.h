// Tables and page of a sweep.
#pragma once

#include <string>
#include <vector>

#include "tools/study/experiment.h"
#include "tools/study/variant_result.h"

namespace rhytid::tools {

/// Names of the files that write_sweep_report may leave in its folder, which no variant may have.
const std::vector<std::string>& sweep_files();

/// results.csv: a row per result, every number. results.md: the same as Markdown, rounded. index.html: one
/// self-contained page with that table, the profiles over one another, wrinkles over time, and per variant
/// its pictures. profiles.svg, amplitude.svg, crests.svg: its plots. `left_out`: a sentence on the variants
/// without a result, for table and page; may be empty. All atomic.
void write_sweep_report(const std::string& folder, const Experiment& experiment,
                        const std::vector<VariantResult>& results, const std::string& left_out);

}  // namespace rhytid::tools
