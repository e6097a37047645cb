// Files that never appear half-written: everything goes to a temporary name in the same folder, is flushed
// to the disk and only then renamed over the final path, which POSIX does atomically.
#pragma once

#include <string>
#include <string_view>

namespace rhytid {

/// A file being written under a temporary name. It becomes visible under its real name by commit(), and
/// leaves nothing behind when it is destroyed without commit (an exception, an early return).
class AtomicFile {
 public:
  /// Opens the temporary file beside `path`. Throws InputError naming `path` when the folder does not
  /// exist or cannot be written.
  explicit AtomicFile(std::string path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends bytes. Throws InputError naming the path (disk full, quota, ...).
  void write(std::string_view bytes);
  /// fsync, rename to the final path, fsync of the folder. At most once. Throws InputError.
  void commit();

 private:
  [[noreturn]] void fail(const char* what) const;

  std::string path_, temporary_;
  int descriptor_ = -1;
};

/// Writes a whole file atomically. Throws InputError naming the path; an older file then stays intact.
void write_file(const std::string& path, std::string_view bytes);

/// Reads a whole file. Throws InputError naming the path.
std::string read_file(const std::string& path);

}  // namespace rhytid
