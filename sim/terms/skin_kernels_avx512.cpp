// Skin kernels compiled for AVX-512 (F, DQ, VL) (flags set in CMakeLists.txt for this file only).
#define RHYTID_ISA isa_avx512
#define RHYTID_SKIN_TABLE(name) name##_table_avx512
#include "sim/terms/skin_kernels.inc"
