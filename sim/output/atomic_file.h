// Files that never appear half-written: everything goes to a temporary name in the same folder, is flushed
// to the disk and only then renamed over the final path, which POSIX does atomically. What a killed process
// left under a temporary name goes when the same file is written the next time.
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

/// The same for writers that open their file themselves and choose its format by the extension, such as video
/// encoders: they write to path(), which nobody else uses and which ends as the real name does.
class AtomicPath {
 public:
  explicit AtomicPath(std::string target);
  ~AtomicPath();  ///< removes what was not committed
  AtomicPath(const AtomicPath&) = delete;
  AtomicPath& operator=(const AtomicPath&) = delete;

  const std::string& path() const { return temporary_; }
  /// fsync of the closed file, rename to the target, fsync of the folder. At most once. Throws InputError
  /// naming the target, also when nothing was written.
  void commit();

 private:
  std::string target_, temporary_;
};

/// Writes a whole file atomically. Throws InputError naming the path; an older file then stays intact.
void write_file(const std::string& path, std::string_view bytes);

/// Reads a whole file. Throws InputError naming the path.
std::string read_file(const std::string& path);

}  // namespace rhytid
