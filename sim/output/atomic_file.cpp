#include "sim/output/atomic_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "sim/core/error.h"

namespace rhytid {

namespace {

std::string folder_of(const std::string& path) {
  const auto slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

constexpr std::string_view kMark = ".tmp-";

/// Part of a temporary name that no other writer uses at the same time.
std::string unique_mark() {
  static std::atomic<unsigned> counter = 0;
  return std::string(kMark) + std::to_string(getpid()) + "-" + std::to_string(counter++);
}

/// The process that chose a unique_mark, 0 when `text` is none.
pid_t process_of_mark(std::string_view text) {
  if (!text.starts_with(kMark)) return 0;
  text.remove_prefix(kMark.size());
  const char* const end = text.data() + text.size();
  pid_t process = 0;
  unsigned count = 0;
  const auto [dash, error] = std::from_chars(text.data(), end, process);
  if (error != std::errc() || dash == end || *dash != '-') return 0;
  const auto [stop, count_error] = std::from_chars(dash + 1, end, count);
  return count_error == std::errc() && stop == end && process > 0 ? process : 0;
}

/// Removes what writers of before + ending left behind when they were killed: regular files of this user,
/// named before + mark + ending, whose process is gone. A process is looked for on this machine only: two
/// machines (or containers) that write the same file of a shared folder at the same time may take away each
/// other's work.
void remove_stale(const std::string& before, const std::string& ending) {
  const std::string folder = folder_of(before);
  const auto slash = before.rfind('/');
  const std::string_view stem =
      slash == std::string::npos ? std::string_view(before) : std::string_view(before).substr(slash + 1);
  DIR* const listing = opendir(folder.c_str());
  if (!listing) return;  // whoever opens the new file says so
  while (const dirent* entry = readdir(listing)) {
    std::string_view name = entry->d_name;
    if (!name.starts_with(stem) || !name.ends_with(ending) || name.size() < stem.size() + ending.size())
      continue;
    const pid_t process =
        process_of_mark(name.substr(stem.size(), name.size() - stem.size() - ending.size()));
    if (process == 0 || kill(process, 0) == 0 || errno != ESRCH) continue;
    struct stat status {};
    if (fstatat(dirfd(listing), entry->d_name, &status, AT_SYMLINK_NOFOLLOW) == 0 &&
        S_ISREG(status.st_mode) && status.st_uid == geteuid())
      unlinkat(dirfd(listing), entry->d_name, 0);
  }
  closedir(listing);
}

/// Opens a new file beside `path` under a name nobody else uses and returns the descriptor, −1 on failure.
/// mkstemp would do, but makes files private, and widening that needs umask(), which is not thread-safe.
int open_temporary(const std::string& path, std::string& name) {
  for (int attempt = 0; attempt < 1000; ++attempt) {
    name = path + unique_mark();
    const int descriptor = open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0 || errno != EEXIST) return descriptor;  // EEXIST: left by a killed process
  }
  return -1;
}

/// Makes a new name itself survive a power cut; some file systems do not support this, which is harmless.
void flush_folder_of(const std::string& path) {
  const int folder = open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY);
  if (folder < 0) return;
  fsync(folder);
  close(folder);
}

[[noreturn]] void fail_at(const std::string& path, const char* what) {
  throw InputError(path + ": " + what + ": " + std::strerror(errno));
}

/// rename() onto a folder would fail only after all the work, so look first.
void require_no_folder(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) {
    throw InputError(path + ": cannot write a file here: it is a folder");
  }
}

}  // namespace

AtomicFile::AtomicFile(std::string path) : path_(std::move(path)) {
  require_no_folder(path_);
  remove_stale(path_, "");
  descriptor_ = open_temporary(path_, temporary_);
  if (descriptor_ < 0) fail("cannot create the file");
}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  close(descriptor_);
  unlink(temporary_.c_str());
}

void AtomicFile::fail(const char* what) const {
  fail_at(path_, what);
}

void AtomicFile::write(std::string_view bytes) {
  require(descriptor_ >= 0, "AtomicFile: write after commit");
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      fail("cannot write");
    }
    bytes.remove_prefix(static_cast<size_t>(written));
  }
}

void AtomicFile::commit() {
  require(descriptor_ >= 0, "AtomicFile: commit twice");
  if (fsync(descriptor_) != 0) fail("cannot flush");
  if (rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot rename the finished file");
  close(descriptor_);
  descriptor_ = -1;
  flush_folder_of(path_);
}

AtomicPath::AtomicPath(std::string target) : target_(std::move(target)) {
  require_no_folder(target_);
  // The mark goes before the extension, by which encoders choose the container.
  const auto slash = target_.rfind('/'), dot = target_.rfind('.');
  const auto stem = slash == std::string::npos ? 0 : slash + 1;
  const auto end = dot == std::string::npos || dot <= stem ? target_.size() : dot;
  remove_stale(target_.substr(0, end), target_.substr(end));
  temporary_ = target_.substr(0, end) + unique_mark() + target_.substr(end);
}

AtomicPath::~AtomicPath() {
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

void AtomicPath::commit() {
  require(!temporary_.empty(), "AtomicPath: commit twice");
  const int descriptor = open(temporary_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail_at(target_, "nothing was written");
  struct stat status {};
  const bool is_empty = fstat(descriptor, &status) != 0 || status.st_size == 0;
  const bool is_flushed = fsync(descriptor) == 0;
  close(descriptor);
  if (is_empty) throw InputError(target_, "a writer that wrote nothing", "free space on the disk");
  if (!is_flushed) fail_at(target_, "cannot flush");
  if (rename(temporary_.c_str(), target_.c_str()) != 0) fail_at(target_, "cannot rename the finished file");
  temporary_.clear();
  flush_folder_of(target_);
}

void write_file(const std::string& path, std::string_view bytes) {
  AtomicFile file(path);
  file.write(bytes);
  file.commit();
}

std::string read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw InputError(path + ": cannot open: " + std::strerror(errno));
  if (std::filesystem::is_directory(path)) throw InputError(path, "a folder", "a file");
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (in.bad()) throw InputError(path + ": cannot read: " + std::strerror(errno));
  return bytes;
}

}  // namespace rhytid
