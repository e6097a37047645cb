// Compiled for AVX-512 (flags set in tools/CMakeLists.txt for this file only).
#define Eigen EigenPlainAvx512
#define RHYTID_PLAIN_SKIN plain_skin_avx512
#include "tools/bench/plain_skin.inc"
