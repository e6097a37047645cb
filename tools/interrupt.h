// Ctrl-C as a flag that long work polls, so that a run stops between iterations with its state on disk.
#pragma once

namespace rhytid::tools {

/// While alive, the first SIGINT or SIGTERM only raises the flag; a second one ends the process at once.
/// One at a time; restores the previous handlers.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
};

/// True once an interrupt has arrived under the living InterruptGuard. Cheap; callable from any thread.
bool interrupt_requested();

}  // namespace rhytid::tools
