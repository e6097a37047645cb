// Tests of what a program may ask of the machine.
#pragma once

#include <sys/resource.h>

#include <fstream>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RHYTID_TEST_IS_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define RHYTID_TEST_IS_SANITIZED 1
#endif
#endif

namespace rhytid::test {

/// While it lives, requests for more than `room` bytes of address space beyond those in use now fail
/// (std::bad_alloc). Without effect under sanitizers, which reserve terabytes.
class MemoryLimit {
 public:
#ifdef RHYTID_TEST_IS_SANITIZED
  static constexpr bool is_effective = false;
#else
  static constexpr bool is_effective = true;
#endif

  explicit MemoryLimit(std::size_t room) {
    getrlimit(RLIMIT_AS, &before_);
    if (!is_effective) return;
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit = before_;
    limit.rlim_cur = 4096 * pages + room;
    setrlimit(RLIMIT_AS, &limit);
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
