// Skin kernels compiled for AVX2 with FMA (flags set in CMakeLists.txt for this file only).
#define RHYTID_ISA isa_avx2
#define RHYTID_SKIN_TABLE(name) name##_table_avx2
#include "sim/terms/skin_kernels.inc"
