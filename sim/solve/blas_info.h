// Which library answers dgemm_: factorisations run several times slower when it is not OpenBLAS.
#pragma once

#include <string>

namespace rhytid {

/// The BLAS that this process really uses, found from the address of dgemm_.
struct BlasInfo {
  std::string shared_object;  ///< path of the shared object, symbolic links resolved; the program itself if
                              ///< linked statically
  std::string name;           ///< "openblas", "atlas", "reference" or "unknown"
  std::string config;         ///< OpenBLAS's own description (version, kernel, threading); empty otherwise
};

/// Never throws on an unknown library; reports it as "unknown".
BlasInfo blas_info();

}  // namespace rhytid
