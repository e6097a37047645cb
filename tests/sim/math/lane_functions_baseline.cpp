// The packed functions compiled for any machine of the platform.
#define RHYTID_LANE_FUNCTIONS lane_functions_baseline
#include "tests/sim/math/lane_functions_of.inc"
