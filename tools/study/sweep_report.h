// Tables and page of a sweep.
#pragma once

#include <string>
#include <vector>

#include "tools/study/experiment.h"
#include "tools/study/variant_result.h"

namespace rhytid::tools {

/// results.csv: a row per variant, every number. results.md: the same as Markdown, rounded. index.html: one
/// self-contained page with that table, the profiles over one another, wrinkles over time, and per variant
/// its pictures. All atomic.
void write_sweep_report(const std::string& folder, const Experiment& experiment,
                        const std::vector<VariantResult>& results);

}  // namespace rhytid::tools
