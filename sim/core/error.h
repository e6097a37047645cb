// How Rhytid says no: bad input is an InputError (one line, exit code 2); a broken contract between
// parts of the program is a ContractError; numerical outcomes are never exceptions but reports.
#pragma once

#include <stdexcept>
#include <string>

namespace rhytid {

/// Bad input from outside (a scene, a mesh, a video, a flag). what() is one line naming where it is,
/// which value was found and what was expected; the programs print it and exit with code 2.
class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& line) : std::runtime_error(line) {}
  /// "where: got 'found', expected expected"
  InputError(const std::string& where, const std::string& found, const std::string& expected)
      : std::runtime_error(where + ": got " + found + ", expected " + expected) {}
};

/// A caller broke a documented contract (sizes, ranges, order of calls): a bug in the caller.
class ContractError : public std::logic_error {
  using std::logic_error::logic_error;
};

/// Throws ContractError with `message` unless `condition` holds. For API edges; never in inner loops.
inline void require(bool condition, const char* message) {
  if (!condition) throw ContractError(message);
}

}  // namespace rhytid
