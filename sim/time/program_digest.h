// The fingerprint of the program that computes.
#pragma once

#include <string>

namespace rhytid {

/// Digest of what decides the bits of a result besides its input: version, configuration, BLAS, kernels, and
/// the contents of this program's own file, since a version says too little while the program is being
/// changed. Computed once. Without /proc the file is left out.
std::string program_digest();

}  // namespace rhytid
