#include "sim/core/digest.h"

#include <fstream>
#include <vector>

#include "sim/core/error.h"

namespace rhytid {

std::string file_digest(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path, "a file that cannot be opened", "a readable one");
  Digest d;
  std::vector<char> block(1 << 20);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    d.bytes(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw InputError(path, "a file that cannot be read to its end", "a readable one");
  return d.hex();
}

}  // namespace rhytid
