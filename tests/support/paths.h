// Where the checkout is, for tests that read its data. One file knows it, so that checkouts share compiled
// objects.
#pragma once

#include <string>

namespace rhytid {

/// Absolute path of the source folder, without a final slash.
std::string source_dir();

}  // namespace rhytid
