#include "tools/bench/program_starts.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>

#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

/// Runs `path --version` with its output thrown away; false when it did not end well.
bool start_once(const std::string& path) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  std::string program = path, option = "--version";
  const std::array<char*, 3> arguments = {program.data(), option.data(), nullptr};
  pid_t process = 0;
  const int failed = posix_spawn(&process, path.c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  int status = 0;
  return failed == 0 && waitpid(process, &status, 0) == process && status == 0;
}

/// Lines that the dynamic loader prints when it is asked what it would load.
int count_libraries(const std::string& path) {
  const std::string command = "LD_TRACE_LOADED_OBJECTS=1 '" + path + "' 2>/dev/null";
  FILE* lines = popen(command.c_str(), "r");
  if (lines == nullptr) return 0;
  int count = 0;
  for (int c = std::fgetc(lines); c != EOF; c = std::fgetc(lines)) count += c == '\n';
  pclose(lines);
  return count;
}

}  // namespace

std::vector<ProgramStart> measure_program_starts(int starts) {
  std::error_code error;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", error);
  std::vector<ProgramStart> programs;
  if (error) return programs;
  std::vector<TimedCall> calls;
  for (const char* name : {"rhytid-forward", "rhytid"}) {
    const std::filesystem::path path = own.parent_path() / name;
    if (!std::filesystem::exists(path, error) || !start_once(path.string())) continue;
    programs.push_back(
        {name, static_cast<double>(std::filesystem::file_size(path, error)), count_libraries(path.string())});
    calls.push_back({[path] { (void)start_once(path.string()); }});
  }
  const std::vector<double> times = median_seconds_of_rounds(starts, calls);
  for (std::size_t k = 0; k < programs.size(); ++k) programs[k].seconds = times[k];
  return programs;
}

}  // namespace rhytid::tools
