// Compiled for AVX2 with FMA (flags set in tools/CMakeLists.txt for this file only).
#define Eigen EigenPlainAvx2
#define RHYTID_PLAIN_SKIN plain_skin_avx2
#include "tools/bench/plain_skin.inc"
