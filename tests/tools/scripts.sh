#!/bin/bash
# The scripts of tools/ on a copy of them: --help prints and does nothing else, what they do not know is refused before
# anything is done, packages that cannot be installed are named, a demo that is finished is not done again, skipped
# tests are counted, and ctest need not be there before the first build.
#   scripts.sh SOURCE_FOLDER SCRATCH_FOLDER
set -u
source=$1 scratch=$2
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
rm -rf "$scratch" && mkdir -p "$scratch/tools" "$scratch/data/scenes" && cd "$scratch" || exit 1
cp -r "$source/data/scenes/demo" data/scenes

for script in "$source"/tools/*; do
  [ -f "$script" ] && [ -x "$script" ] && cp "$script" tools
done
cp "$source/tools/script_help" tools
for script in tools/*; do
  [ -x "$script" ] || continue
  name=$(basename "$script")
  timeout 10 "$script" --help >out.txt 2>err.txt || fail "$name --help: exit $?"
  grep -q "tools/$name" out.txt || fail "$name --help does not say how it is called: $(cat out.txt)"
  timeout 10 "$script" --no-such-option >out.txt 2>err.txt
  [ $? = 2 ] || fail "$name --no-such-option is not refused: $(head -3 out.txt err.txt)"
done
timeout 10 tools/demo one two >out.txt 2>err.txt
[ $? = 2 ] || fail "demo takes two folders"
timeout 10 tools/test demo >out.txt 2>err.txt
[ $? = 2 ] || fail "test takes a word that is no option"
[ "$(ls | tr '\n' ' ')" = "data err.txt out.txt tools " ] || fail "files appeared: $(ls)"

# Installation over stand-ins for dpkg and apt-get, and nothing else in PATH than what the script needs.
mkdir bin
for command in dirname sed grep mktemp rm env tail cat; do ln -s "$(command -v $command)" bin; done
stand_in() { cat >"bin/$1" && chmod +x "bin/$1"; }
# give_up WHAT MISSING: install_packages, and the build that begins with it, end with this one error and what to do.
give_up() {
  local script
  for script in install_packages build; do
    PATH=$scratch/bin tools/$script >out.txt 2>err.txt </dev/null
    [ $? = 1 ] || fail "$1: $script exits otherwise than with 1"
    [ "$(grep -c 'error:' err.txt)" = 1 ] && grep -qF "rhytid: error: $1" err.txt || fail "$1: $script says $(cat err.txt)"
    grep -qx "Missing packages: $2" err.txt || fail "$1: $script does not name what is missing: $(cat err.txt)"
    grep -qx "  apt-get update && apt-get install --no-install-recommends $2" err.txt ||
      fail "$1: $script does not say what to run: $(cat err.txt)"
  done
}
give_up "this system has no apt-get" "cmake ninja-build g++ libeigen3-dev .* python3 python3-vtk9"
echo 'libceres-dev libnlopt-dev' >missing.txt
stand_in dpkg-query <<STAND_IN
#!/bin/bash
for last; do :; done
case " \$(cat $scratch/missing.txt) " in *" \$last "*) exit 1 ;; esac
echo "install ok installed"
STAND_IN
stand_in apt-get <<STAND_IN
#!/bin/bash
echo "\$*" >>$scratch/calls.txt
. $scratch/apt_does
STAND_IN
echo 'echo "E: Unable to fetch some archives"; exit 100' >apt_does
echo 'echo 1000' | stand_in id
give_up "not root and there is no sudo" "libceres-dev libnlopt-dev"
[ ! -e calls.txt ] || fail "apt-get is called without root: $(cat calls.txt)"
stand_in sudo <<'STAND_IN'
#!/bin/bash
[ "$1" = -n ] && echo "sudo: a password is required" || echo "sudo waits for a password"
exit 1
STAND_IN
give_up "apt-get could not install what is missing" "libceres-dev libnlopt-dev"
grep -q '^sudo: a password is required$' err.txt || fail "without a terminal sudo is let to wait: $(cat err.txt)"
echo 'echo 0' | stand_in id
give_up "apt-get could not install what is missing" "libceres-dev libnlopt-dev"
grep -q '^E: Unable to fetch' err.txt || fail "what apt-get says is kept back: $(cat err.txt)"
grep -q ' update$' calls.txt || fail "the lists are not refreshed: $(cat calls.txt)"
echo "echo libnlopt-dev >$scratch/missing.txt" >apt_does
give_up "apt-get ran, but not everything is there" "libnlopt-dev"
echo ": >$scratch/missing.txt" >apt_does
PATH=$scratch/bin tools/install_packages >out.txt 2>err.txt || fail "packages can be installed: $(cat err.txt)"
: >calls.txt
PATH=$scratch/bin tools/install_packages >out.txt 2>err.txt || fail "all is there: $(cat err.txt)"
[ ! -s calls.txt ] && [ ! -s out.txt ] || fail "packages that are there are installed: $(cat calls.txt out.txt)"
rm calls.txt

# The demo over stand-ins for the build and the program.
mkdir -p build/release/bin
printf '#!/bin/bash\n' >tools/build
cat >build/release/bin/rhytid <<'PROGRAM'
#!/bin/bash
# VERB case.json -o FOLDER
mkdir -p "$4" && echo "$1" >>calls.txt
case $1 in
  render) for file in camera.yaml truth_tracks.csv truth.json; do echo 1 >"$4/$file"; done ;;
  track) echo 1 >"$4/tracks.csv" && echo 1 >"$4/track.json" ;;
  fit) echo '"converged": true,' >"$4/fit.json"; echo "the answer" | tee "$4/answer.txt"; echo 1 >"$4/report.html" ;;
esac
PROGRAM
chmod +x tools/build build/release/bin/rhytid
called() { tr '\n' ' ' <calls.txt; : >calls.txt; }
tools/demo >out.txt 2>&1 || fail "demo: $(cat out.txt)"
[ "$(called)" = "render track fit " ] || fail "a first demo does not do everything"
tools/demo >out.txt 2>&1 || fail "demo again: $(cat out.txt)"
[ "$(called)" = "" ] || fail "a finished demo is done again"
grep -q '^the answer$' out.txt || fail "a finished demo does not show its answer: $(cat out.txt)"
sed -i 's/true/false/' run/demo/fit.json && touch run/demo/answer.txt run/demo/report.html
tools/demo >out.txt 2>&1
[ "$(called)" = "fit " ] || fail "a fit that did not converge is left at that"
# A render that was killed before its last file left the rest as new as it would be.
sleep 0.02 && rm run/demo/truth.json && touch run/demo/truth_tracks.csv
tools/demo >out.txt 2>&1
[ "$(called)" = "render track fit " ] || fail "footage without its truth is taken for rendered"
sleep 0.02 && touch data/scenes/demo/scene.json
tools/demo >out.txt 2>&1
[ "$(called)" = "render track fit " ] || fail "a changed scene does not start the demo over"

# The tests over a stand-in for ctest, which leaves what it printed and the output of every test.
mkdir -p build/release/Testing/Temporary
stand_in ctest <<'STAND_IN'
#!/bin/bash
cat ctest_prints.txt
exit 8
STAND_IN
cat >ctest_prints.txt <<'PRINTS'
80% tests passed, 1 tests failed out of 5

The following tests did not run:
	2 - Head.IsReadWhole (Skipped)
	3 - Vtu.ReadsBack (Skipped)
	4 - Head.Extrudes (Skipped)
	5 - hygiene.format (Skipped)
PRINTS
cat >build/release/Testing/Temporary/LastTest.log <<'LOG'
../../tests/head_test.cpp:19: Skipped
RHYTID_REALDATA is not set
[  SKIPPED ] Head.IsReadWhole (0 ms)
../../tests/vtu_test.cpp:8: Skipped
no module vtk
../../tests/head_test.cpp:19: Skipped
RHYTID_REALDATA is not set
skipped: clang-format is not installed
LOG
reasons='(2: RHYTID_REALDATA is not set; 1: clang-format is not installed; 1: no module vtk)'
LC_ALL=C PATH=$scratch/bin:$PATH tools/test >out.txt 2>&1
[ $? = 8 ] || fail "the tests' exit code is lost"
[ "$(tail -1 out.txt)" = "Skipped 4 of 5 tests $reasons" ] || fail "skipped tests: $(cat out.txt)"
echo '100% tests passed, 0 tests failed out of 5' >ctest_prints.txt
PATH=$scratch/bin:$PATH tools/test >out.txt 2>&1
[ "$(tail -1 out.txt)" = "Skipped none of 5 tests" ] || fail "no skipped tests: $(cat out.txt)"

# On a system without ctest, which comes with the build, its options are known all the same.
for command in nproc tee sort uniq paste mv; do ln -s "$(command -v $command)" bin; done
stand_in ctest.to_come <<'STAND_IN'
#!/bin/bash
[ "$*" = --help ] && echo "  -L <regex>, --label-regex <regex> = Run tests with labels" || cat ctest_prints.txt
STAND_IN
printf '#!/bin/bash\n[ ! -e bin/ctest.to_come ] || mv bin/ctest.to_come bin/ctest\n' >tools/build
rm bin/ctest
PATH=$scratch/bin tools/test -L hygiene >out.txt 2>&1 || fail "the first tests of a system: $(cat out.txt)"
[ "$(cat out.txt)" = "$(cat ctest_prints.txt; echo "Skipped none of 5 tests")" ] || fail "first tests: $(cat out.txt)"
mv bin/ctest bin/ctest.to_come
PATH=$scratch/bin tools/test --no-such-option >out.txt 2>&1
[ $? = 2 ] && grep -q "got '--no-such-option'" out.txt || fail "an unknown option before ctest came: $(cat out.txt)"
exit $((failures > 0))
