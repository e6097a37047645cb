// A short fingerprint of data, by which saved work knows what it belongs to.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

#include "sim/core/types.h"

namespace rhytid {

/// FNV-1a with 64 bits: tells versions of the same thing apart, no defence against forgery.
class Digest {
 public:
  void bytes(const void* data, std::size_t size) {
    const auto* byte = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) state_ = (state_ ^ byte[i]) * 0x100000001b3ull;
  }
  void text(const std::string& s) {
    number(static_cast<double>(s.size()));
    bytes(s.data(), s.size());
  }
  void number(double x) { bytes(&x, sizeof(x)); }
  template <class Matrix>
  void matrix(const Matrix& m) {
    number(static_cast<double>(m.rows()));
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index j = 0; j < m.cols(); ++j) number(m(i, j));
  }
  std::string hex() const {
    char out[24];
    std::snprintf(out, sizeof(out), "%016llx", static_cast<unsigned long long>(state_));
    return out;
  }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325ull;
};

/// Digest of a file's contents. Throws InputError when it cannot be read.
std::string file_digest(const std::string& path);

}  // namespace rhytid
