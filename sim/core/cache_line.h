// Arrays that begin on a cache line, for tables that are read in whole vectors: a vector that crosses a line costs two
// reads.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace rhytid {

template <class T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t alignment{64};
  CacheLineAllocator() = default;
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), alignment)); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, alignment); }
  friend bool operator==(const CacheLineAllocator&, const CacheLineAllocator&) { return true; }
};

using CacheLineDoubles = std::vector<double, CacheLineAllocator<double>>;

}  // namespace rhytid
