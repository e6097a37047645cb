#!/bin/bash
# The command line of a real program: exit codes, and one line on stderr when something is wrong.
#   exit_codes.sh PROGRAM
set -u
program=$1
failures=0

# expect CODE LINES_ON_STDERR PATTERN ARGUMENTS...: PATTERN must occur in stdout and stderr together.
expect() {
  local code=$1 lines=$2 pattern=$3
  shift 3
  local out err actual
  err=$(mktemp)
  out=$("$program" "$@" 2>"$err")
  actual=$?
  if [ "$actual" != "$code" ] || [ "$(wc -l <"$err")" != "$lines" ] ||
     ! printf '%s\n' "$out" | cat - "$err" | grep -qE -- "$pattern"; then
    echo "FAILED: $(basename "$program") $*: exit $actual (expected $code), stderr:"
    sed 's/^/    /' "$err"
    failures=$((failures + 1))
  fi
  rm -f "$err"
}

expect 0 0 '^rhytid.* [0-9]+\.[0-9]+\.[0-9]+ ' --version
expect 0 0 'doctor' --help
expect 0 0 '^Example' doctor --help
expect 0 0 '"\$schema"' schema
expect 0 0 '"title": "Rhytid experiment"' schema experiment
expect 0 0 '^# The scene file' schema --docs
expect 2 1 "^rhytid: error: schema: got 'nonsense', expected one of scene" schema nonsense
case $(basename "$program") in
  rhytid) expect 0 0 '"title": "Rhytid case"' schema case
    expect 0 0 '`/fit/parameters/\*/address` \| string' schema case --docs ;;
  *) expect 2 1 "^rhytid: error: schema: got 'case', expected one of scene, experiment, steps$" schema case ;;
esac
expect 0 0 '^\| `iterations`' schema steps
expect 2 1 "^rhytid: error: bench: got 'nope', expected one of stability" bench nope
expect 2 1 '^rhytid: error: bench: got nothing' bench
expect 2 1 '^rhytid: error: --uniaxial: got 0, expected a stretch > 0' material --uniaxial 0
expect 2 1 '^rhytid: error: verb: got nothing'
expect 2 1 "^rhytid: error: verb: got 'no-such-verb', expected one of .*doctor" no-such-verb
expect 2 1 '^rhytid: error: .*--no-such-option' doctor --no-such-option
expect 2 1 '^rhytid: error: --threads' doctor --threads 0
expect 2 1 '^\{"event":"error","text":".*--threads' doctor --threads 0 --log-json
if [ -e /dev/full ]; then
  "$program" doctor >/dev/full 2>/dev/null
  [ $? = 1 ] || { echo "FAILED: a full disk on stdout must not exit with 0"; failures=$((failures + 1)); }
fi
exit $((failures > 0))
