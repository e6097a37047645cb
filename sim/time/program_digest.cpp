#include "sim/time/program_digest.h"

#include "sim/core/build_info.h"
#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/solve/blas_info.h"
#include "sim/terms/kernel_table.h"

namespace rhytid {
namespace {

std::string compute() {
  Digest d;
  const BuildInfo build = build_info();
  const BlasInfo blas = blas_info();
  for (const std::string& s : {build.version, build.build_type, build.compiler, build.sanitizers,
                               blas.shared_object, blas.config, std::string(skin_kernel_isa())})
    d.text(s);
  try {
    d.text(file_digest("/proc/self/exe"));
  } catch (const InputError&) {
    d.text("no /proc");
  }
  return d.hex();
}

}  // namespace

std::string program_digest() {
  static const std::string digest = compute();
  return digest;
}

}  // namespace rhytid
