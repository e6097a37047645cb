#include "tools/peak_memory.h"

#include <cstdlib>
#include <fstream>
#include <string>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace rhytid::tools {

std::optional<double> take_peak_memory() {
  static bool can_reset = true;
  std::optional<double> peak;
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) peak = std::strtod(line.c_str() + 6, nullptr) * 1024 / 1e6;
  if (!can_reset) return std::nullopt;
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  std::ofstream reset("/proc/self/clear_refs");
  reset << "5" << std::flush;
  can_reset = reset.good();
  return peak;
}

}  // namespace rhytid::tools
