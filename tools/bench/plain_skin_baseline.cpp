#define Eigen EigenPlain
#define RHYTID_PLAIN_SKIN plain_skin_baseline
#include "tools/bench/plain_skin.inc"
