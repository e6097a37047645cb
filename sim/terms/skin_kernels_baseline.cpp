// Skin kernels for any machine of the platform.
#define RHYTID_SKIN_TABLE skin_table_baseline
#define RHYTID_ELASTIC_TABLE elastic_table_baseline
#include "sim/terms/skin_kernels.inc"
