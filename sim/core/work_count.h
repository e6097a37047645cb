// A count of work done, for tests and reports: what a scene does not have must leave its counts at zero.
#pragma once

#include <atomic>

namespace rhytid {

/// A count that several threads may raise; reads as a number, copies as one.
class WorkCount {
 public:
  WorkCount() = default;
  WorkCount(const WorkCount& other) : n_(other.n_.load(std::memory_order_relaxed)) {}
  WorkCount& operator=(const WorkCount& other) {
    n_.store(other.n_.load(std::memory_order_relaxed), std::memory_order_relaxed);
    return *this;
  }
  void operator++() { n_.fetch_add(1, std::memory_order_relaxed); }
  operator long() const { return n_.load(std::memory_order_relaxed); }

 private:
  std::atomic<long> n_{0};
};

}  // namespace rhytid
