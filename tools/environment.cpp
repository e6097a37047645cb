#include "tools/environment.h"

#include <cholmod.h>
#include <link.h>
#include <omp.h>
#include <png.h>
#include <sys/utsname.h>

#include <Eigen/Core>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "sim/core/build_info.h"
#include "sim/solve/blas_info.h"

extern "C" int openblas_get_num_threads();
extern "C" int openblas_get_parallel();

namespace rhytid::tools {
namespace {

using Verdict = EnvironmentFact::Verdict;

std::string join(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

template <class... Numbers>
std::string dotted(Numbers... numbers) {
  return join({std::to_string(numbers)...}, ".");
}

/// Loaded libraries whose file name speaks of BLAS or LAPACK.
std::vector<std::string> loaded_blas_libraries() {
  std::set<std::string> names;
  dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* data) {
        const std::string name = std::filesystem::path(info->dlpi_name).filename().string();
        const bool is_blas = name.find("blas") != std::string::npos ||
                             name.find("atlas") != std::string::npos ||
                             name.find("lapack") != std::string::npos;
        if (is_blas) static_cast<std::set<std::string>*>(data)->insert(name);
        return 0;
      },
      &names);
  return {names.begin(), names.end()};
}

std::string processor_name() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(std::min(line.size(), line.find(':') + 2));
  }
  return "unknown";
}

std::string vector_instructions() {
  std::vector<std::string> found;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("sse4.2")) found.push_back("sse4.2");
  if (__builtin_cpu_supports("avx")) found.push_back("avx");
  if (__builtin_cpu_supports("avx2")) found.push_back("avx2");
  if (__builtin_cpu_supports("fma")) found.push_back("fma");
  if (__builtin_cpu_supports("avx512f")) found.push_back("avx512f");
#endif
  return found.empty() ? "none known" : join(found, " ");
}

}  // namespace

std::vector<EnvironmentFact> simulator_environment(int threads) {
  const BuildInfo build = build_info();
  utsname system = {};
  uname(&system);
  int cholmod_numbers[3] = {};
  cholmod_version(cholmod_numbers);

  const BlasInfo blas = blas_info();
  const Verdict blas_verdict = blas.name == "openblas" ? Verdict::good : Verdict::bad;
  return {
      {"rhytid", build.version + ", " + build.build_type + ", " + build.compiler +
                     (build.sanitizers.empty() ? "" : ", sanitizers " + build.sanitizers)},
      {"system", std::string(system.sysname) + " " + system.release + " " + system.machine},
      {"processor", processor_name()},
      {"vector instructions", vector_instructions()},
      {"threads", std::to_string(threads) + " in use, " + std::to_string(omp_get_num_procs()) +
                      " cores, OpenMP " + std::to_string(_OPENMP) + ", OpenBLAS " +
                      std::to_string(openblas_get_num_threads()) +
                      (openblas_get_parallel() == 0 ? " (sequential: factorisations use one thread)" : "")},
      {"dgemm_ is answered by", blas.name + ", " + blas.shared_object, blas_verdict},
      {"BLAS configuration", blas.config.empty() ? "unknown" : blas.config},
      {"BLAS and LAPACK loaded", join(loaded_blas_libraries(), " ")},
      {"Eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
      {"CHOLMOD", dotted(cholmod_numbers[0], cholmod_numbers[1], cholmod_numbers[2])},
      {"nlohmann-json",
       dotted(NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH)},
      {"libpng", png_get_libpng_ver(nullptr)},
  };
}

}  // namespace rhytid::tools
