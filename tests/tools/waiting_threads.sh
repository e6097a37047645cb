#!/bin/bash
# A program makes its waiting OpenMP threads sleep by itself, starts anew for that once, and obeys the user.
#   waiting_threads.sh PROGRAM
# libgomp prints its settings each time it is loaded: one block per start of the program.
set -u
program=$1
failures=0
unset OMP_WAIT_POLICY GOMP_SPINCOUNT
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }

# expect PATTERN SETTING...: how long threads spin at each start, in order; with no setting of the user's.
expect() {
  local pattern=$1 found
  shift
  found=$(env OMP_DISPLAY_ENV=VERBOSE "$@" "$program" "${arguments[@]}" 2>&1 >/dev/null |
          sed -n "s/.*GOMP_SPINCOUNT = '\(.*\)'.*/\1/p" | paste -sd ' ')
  [[ $found =~ ^$pattern$ ]] || fail "$*: spin counts '$found', expected '$pattern'"
}

arguments=(schema)
expect '[1-9][0-9]* 0'
expect '[1-9A-Z][0-9A-Z]*' OMP_WAIT_POLICY=active
expect 0 OMP_WAIT_POLICY=passive
expect 1000 GOMP_SPINCOUNT=1000
arguments=(--version)
expect '[1-9][0-9]*'
# Arguments, standard input and output and the exit code come through.
"$program" doctor --no-such-option >/dev/null 2>&1
[ $? = 2 ] || fail "the exit code of bad input is lost"
[ "$("$program" schema </dev/null | head -c 1)" = "{" ] || fail "arguments are lost"
# What pgrep and top call the process is the program: looked at while it waits for somebody to read the rest of 190 kB.
exec 3< <(exec "$program" schema)
pid=$!
read -r -u 3 _
name=$(cat /proc/$pid/comm)
exec 3<&-
[ "$name" = "$(basename "$program")" ] || fail "the process is called '$name'"
# Through the loader the program runs, though it cannot start anew.
loader=$(find /lib64 /lib -maxdepth 1 -name 'ld-linux*.so.*' 2>/dev/null | head -n 1)
[ -z "$loader" ] || "$loader" "$program" --version | grep -q . || fail "$loader $program --version"
exit $((failures > 0))
