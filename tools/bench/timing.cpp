#include "tools/bench/timing.h"

#include <algorithm>
#include <chrono>
#include <ctime>

#include "sim/core/parallel.h"

namespace rhytid::tools {
namespace {

using Times = std::vector<std::vector<double>>;  // by call, then round

/// Times of all calls, once each a round for as long as `more` says.
Times times_of_rounds(const std::vector<TimedCall>& calls,
                      const std::function<bool(std::size_t round)>& more) {
  Times times(calls.size());
  for (std::size_t round = 0; more(round); ++round)
    for (std::size_t k = 0; k < calls.size(); ++k) {
      if (calls[k].before) calls[k].before();
      const auto clock = calls[k].by_thread ? thread_seconds : clock_seconds;
      const double start = clock();
      calls[k].call();
      times[k].push_back(clock() - start);
    }
  return times;
}

std::vector<double> medians(const Times& times) {
  std::vector<double> result;
  for (const std::vector<double>& t : times) result.push_back(median(t));
  return result;
}

/// Three rounds, and more until `seconds` from now have passed or `go_on` says false.
std::function<bool(std::size_t)> rounds_of(double seconds, const std::function<bool()>& go_on = {}) {
  return [end = clock_seconds() + seconds, go_on](std::size_t round) {
    constexpr std::size_t most = 100000;
    if (round > 0 && go_on && !go_on()) return false;
    return round < 3 || (clock_seconds() < end && round < most);
  };
}

}  // namespace

double clock_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double cpu_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

std::vector<double> median_seconds_in_turn(double seconds, const std::vector<TimedCall>& calls,
                                           const std::function<bool()>& go_on) {
  return medians(times_of_rounds(calls, rounds_of(seconds * static_cast<double>(calls.size()), go_on)));
}

std::vector<double> median_seconds_of_rounds(int rounds, const std::vector<TimedCall>& calls) {
  return medians(times_of_rounds(
      calls, [&](std::size_t round) { return round < static_cast<std::size_t>(std::max(1, rounds)); }));
}

ThreadTimes fastest_seconds_by_threads(double seconds, const std::function<void()>& call) {
  const int threads = num_threads();
  const auto use = [](int count) { return [count] { set_num_threads(count); }; };
  const auto fastest = [](const std::vector<double>& times) {
    return *std::min_element(times.begin(), times.end());
  };
  const auto times = times_of_rounds({{call, use(1)}, {call, use(threads)}}, rounds_of(2 * seconds));
  set_num_threads(threads);
  return {fastest(times[0]), fastest(times[1])};
}

}  // namespace rhytid::tools
