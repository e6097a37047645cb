// Tests of what a program may ask of the machine.
#pragma once

#include <sys/resource.h>

#include <fstream>

namespace rhytid::test {

/// While it lives, requests for more than `room` bytes of address space beyond those in use now fail
/// (std::bad_alloc). Without effect under AddressSanitizer and ThreadSanitizer, which reserve terabytes.
class MemoryLimit {
 public:
  explicit MemoryLimit(std::size_t room) {
    getrlimit(RLIMIT_AS, &before_);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit = before_;
    limit.rlim_cur = 4096 * pages + room;
    setrlimit(RLIMIT_AS, &limit);
#endif
  }
  ~MemoryLimit() {
    setrlimit(RLIMIT_AS, &before_);
  }
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

 private:
  rlimit before_{};
};

}  // namespace rhytid::test
