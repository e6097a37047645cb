// The packed functions compiled for AVX2 with FMA (flags set in CMakeLists.txt for this file only).
#define RHYTID_ISA isa_avx2
#define RHYTID_LANE_FUNCTIONS lane_functions_avx2
#include "tests/sim/math/lane_functions_of.inc"
