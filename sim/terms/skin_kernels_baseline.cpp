// Skin kernels for any machine of the platform.
#define RHYTID_SKIN_TABLE(name) name##_table_baseline
#include "sim/terms/skin_kernels.inc"
