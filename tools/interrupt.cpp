#include "tools/interrupt.h"

#include <signal.h>

#include <atomic>

namespace rhytid::tools {
namespace {

std::atomic<bool> requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "the signal handler may only touch lock-free objects");
struct sigaction previous_int, previous_term;

extern "C" void raise_flag(int) {
  requested.store(true);
}

}  // namespace

InterruptGuard::InterruptGuard() {
  requested.store(false);
  struct sigaction action = {};
  action.sa_handler = raise_flag;
  sigemptyset(&action.sa_mask);
  // SA_RESETHAND: the second signal finds the default action, so a stuck program can still be stopped.
  action.sa_flags = SA_RESETHAND | SA_RESTART;
  sigaction(SIGINT, &action, &previous_int);
  sigaction(SIGTERM, &action, &previous_term);
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &previous_int, nullptr);
  sigaction(SIGTERM, &previous_term, nullptr);
}

bool interrupt_requested() {
  return requested.load(std::memory_order_relaxed);
}

}  // namespace rhytid::tools
