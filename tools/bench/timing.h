// Times of calls.
#pragma once

#include <functional>
#include <vector>

namespace rhytid::tools {

/// Seconds of a clock that only goes forward.
double clock_seconds();
/// Processor time of the calling thread, s: stands still while others have the core.
double thread_seconds();

/// CPU seconds of all threads of this process so far.
double cpu_seconds();
/// Of a sorted copy; the mean of the two in the middle when their number is even. `values` has one at least.
double median(std::vector<double> values);

/// A call to time, and what is done before each time without being timed.
struct TimedCall {
  std::function<void()> call, before = {};
  /// The time of the calling thread counts, for calls on one thread: what else runs on the machine is not in it,
  /// but for caches that it shares.
  bool by_thread = false;
};

/// Median times of several calls that take turns, s, so that what else the machine does falls on all of them alike:
/// rounds until `seconds` per call have passed, at least three. Ends early, with what there is, when `go_on`
/// says false.
std::vector<double> median_seconds_in_turn(double seconds, const std::vector<TimedCall>& calls,
                                           const std::function<bool()>& go_on = {});

/// The same with a number of rounds, at least one.
std::vector<double> median_seconds_of_rounds(int rounds, const std::vector<TimedCall>& calls);

/// Fastest calls on one thread and on all of num_threads(), s, which take turns for `seconds` each: what else the
/// machine does can only add.
struct ThreadTimes {
  double one = 0, all = 0;
};
ThreadTimes fastest_seconds_by_threads(double seconds, const std::function<void()>& call);

}  // namespace rhytid::tools
