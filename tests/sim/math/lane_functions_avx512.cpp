// The packed functions compiled for AVX-512 (flags set in CMakeLists.txt for this file only).
#define RHYTID_ISA isa_avx512
#define RHYTID_LANE_FUNCTIONS lane_functions_avx512
#include "tests/sim/math/lane_functions_of.inc"
