#!/bin/bash
# A case of two clips in the real program: render and track by clip, one fit, its files, its report, messages.
#   joint_fit.sh PROGRAM SCRATCH_FOLDER
set -u
program=$1 scratch=$2 tests=$(realpath "$(dirname "$0")")
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
rm -rf "$scratch" && mkdir -p "$scratch" && cd "$scratch" || exit 1

cp "$tests/tiny_scene.json" scene.json || exit 1
cat >case.json <<'CASE'
{
  "scene": "scene.json",
  "truth": {"settings": ["/colliders/finger/friction/coefficient=0.8"]},
  "render": {"width": 160, "height": 120, "texture_scale": "0.6 mm", "truth_spacing": 8},
  "track": {"max_tracks": 60, "min_distance": 6},
  "clips": [
    {"name": "left"},
    {"name": "back", "settings": [
      "/colliders/finger/path=[{\"time\": 0, \"position\": [3, 2, 2.02]}, {\"time\": 0.1, \"position\": [3, 2, 1.5]}, {\"time\": 0.3, \"position\": [1, 2, 1.5]}]"]}],
  "fit": {"parameters": [{"address": "/ligaments/stiffness"},
                         {"address": "/clips/*/colliders/finger/friction/coefficient", "initial": 0.4, "lower": 0.125}],
          "max_evaluations": 3}
}
CASE

# expect CODE PATTERN ARGUMENTS...: PATTERN somewhere in stdout and stderr together.
expect() {
  local code=$1 pattern=$2 actual
  shift 2
  "$program" "$@" --threads 1 >out.txt 2>err.txt
  actual=$?
  [ "$actual" = "$code" ] || fail "$*: exit $actual, expected $code: $(cat err.txt)"
  [ "$code" != 2 ] || [ "$(wc -l <err.txt)" = 1 ] || fail "$*: more than a line on stderr: $(cat err.txt)"
  cat out.txt err.txt | grep -qE -- "$pattern" || fail "$*: no '$pattern' in: $(cat out.txt err.txt)"
}

expect 2 '^rhytid: error: --clip: got none, expected one of left, back$' render case.json -o a
expect 2 '^rhytid: error: --clip: got right, expected one of left, back$' track case.json -o a --clip right
expect 2 "^rhytid: error: clip 'left': a/left/tracks.csv: got no file, and no footage a/left/footage.avi to track" \
  fit case.json -o a
expect 2 '/fit/parameters/0/address: got "/clips/bck/ligaments/stiffness", .* nearest is "back"$' \
  fit case.json -o a --set /fit/parameters/0/address=/clips/bck/ligaments/stiffness
for clip in left back; do
  expect 0 "a/$clip/footage.avi: 5 frames" render case.json -o a --clip $clip
done
expect 0 'a/back/tracks.csv: 5 of 5 frames' track case.json -o a --clip back

# The fit tracks what is not tracked yet; three evaluations do not converge.
expect 3 'no tracks yet \(a/left/tracks.csv\): tracking' fit case.json -o a
grep -q 'tracking a/back' err.txt && fail "valid tracks of a clip were not taken"
grep -qE '^note: clip back: [0-9]+ tracks on the skin|clip back: [0-9]+ tracks on the skin' err.txt || fail "no tracks of a clip: $(cat err.txt)"
grep -qE '^finger friction coefficient \(back\) .* 0\.8 ' out.txt || fail "no truth of a clip: $(cat out.txt)"
grep -qE '^back +camera +4 ' out.txt || fail "no table of clips: $(cat out.txt)"
for file in fit.json residuals.csv fitted_scene.json answer.txt report.html left/fitted_scene.json \
  back/fitted_scene.json evaluations/left/identity.json evaluations/back/identity.json; do
  [ -s "a/$file" ] || fail "a/$file is missing or empty"
done
head -1 a/residuals.csv | grep -q ',clip,camera$' || fail "residuals do not name their clip"
for text in 'Clip left' 'Clip back' 'reduced chi-square'; do
  grep -q "$text" a/report.html || fail "the report lacks $text"
done
[ "$(grep -o 'data:image/jpeg' a/report.html | wc -l)" -ge 3 ] || fail "the report does not show both clips' footage"

# What was computed is not computed again, and addresses of the record are those of the command line.
expect 3 'run 3 \([0-9.]+ s then\)' fit case.json -o a \
  --parameters /ligaments/stiffness,/clips/left/colliders/finger/friction/coefficient,/clips/back/colliders/finger/friction/coefficient
expect 2 "^rhytid: error: clip 'back'.*usable observations|^rhytid: error: clip 'back'" fit case.json -o a \
  --set '/clips/back/tracks="none.csv"' --set '/clips/back/footage="none.avi"'

[ "$failures" = 0 ] || { echo "$failures failures"; exit 1; }
