// The packed functions of one instruction set as plain calls over arrays, so that a test compiled for any machine can
// reach those that the processor has.
#pragma once

namespace rhytid::test {

/// Arrays have `count` numbers, a multiple of 8.
struct LaneFunctions {
  const char* isa;
  int lanes;
  void (*log1p)(const double* x, double* out, int count);
  void (*expm1)(const double* x, double* out, int count);
  void (*sinhc)(const double* x, double* out, int count);
  void (*log_quotients)(const double* a, const double* b, const double* difference, double* log,
                        double* slope, int count);
  /// ordinary: 1 where it is, else 0.
  void (*log_deviator)(const double* c, const double* j2, const double* j3, double* a1, double* a2,
                       double* square, double* ordinary, int count);
};

/// Those of instruction sets that this build lacks are declared only.
extern const LaneFunctions lane_functions_baseline, lane_functions_avx2, lane_functions_avx512;

}  // namespace rhytid::test
