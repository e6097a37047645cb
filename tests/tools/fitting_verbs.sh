#!/bin/bash
# render, track, fit and report of the real program on a tiny twin experiment: exit codes, files, one line on errors,
# and a fit that is killed and goes on to the same bits.
#   fitting_verbs.sh PROGRAM SCRATCH_FOLDER
set -u
program=$1 scratch=$2 tests=$(realpath "$(dirname "$0")")
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
rm -rf "$scratch" && mkdir -p "$scratch" && cd "$scratch" || exit 1

cp "$tests/tiny_scene.json" scene.json || exit 1
cat >case.json <<'CASE'
{
  "scene": "scene.json",
  "settings": ["/skin/layers/skin/poissons_ratio=0.45"],
  "truth": {"settings": ["/colliders/finger/friction/coefficient=0.8"]},
  "render": {"width": 160, "height": 120, "texture_scale": "0.6 mm", "truth_spacing": 8},
  "track": {"max_tracks": 60, "min_distance": 6},
  "fit": {"parameters": [{"address": "/colliders/finger/friction/coefficient", "initial": 0.4, "lower": 0.125}]}
}
CASE

# expect CODE ERRORS PATTERN ARGUMENTS...: so many lines with "error:" on stderr (and nothing else when the code is
# 2), and PATTERN somewhere in stdout and stderr together.
expect() {
  local code=$1 errors=$2 pattern=$3 actual
  shift 3
  "$program" "$@" --threads 1 >out.txt 2>err.txt
  actual=$?
  [ "$actual" = "$code" ] || fail "$*: exit $actual, expected $code: $(cat err.txt)"
  [ "$(grep -c 'error: ' err.txt)" = "$errors" ] || fail "$*: $(grep -c 'error: ' err.txt) errors: $(cat err.txt)"
  [ "$code" != 2 ] || [ "$(wc -l <err.txt)" = 1 ] || fail "$*: more than a line on stderr: $(cat err.txt)"
  cat out.txt err.txt | grep -qE -- "$pattern" || fail "$*: no '$pattern' in: $(cat out.txt err.txt)"
}
# written FOLDER FILE...: all there, not empty, and no temporary names left.
written() {
  local folder=$1 file
  shift
  for file in "$@"; do [ -s "$folder/$file" ] || fail "$folder/$file is missing or empty"; done
  [ -z "$(find "$folder" -name '*.tmp-*')" ] || fail "left behind: $(find "$folder" -name '*.tmp-*')"
}
# The record of a fit without wall clock times.
record() {
  python3 - "$1" <<'PYTHON'
import json, sys
fit = json.load(open(sys.argv[1] + "/fit.json"))
for key in ("seconds", "forward_seconds"):
    del fit[key]
for step in fit["history"] + fit["systematic"] + fit.get("stages", []):
    del step["seconds"]
print(json.dumps(fit, indent=1))
for name in ("residuals.csv", "fitted_scene.json", "answer.txt"):
    print(open(sys.argv[1] + "/" + name).read())
PYTHON
}

# Bad input first.
expect 2 1 '^rhytid: error: a/tracks.csv: got no file, and no footage a/footage.avi to track, expected tracks, or' \
  fit case.json -o a
expect 2 1 '^rhytid: error: --parameters: .*/ligaments/sources/c/strength' \
  fit case.json -o a --parameters /ligaments/sources/c/strength
expect 2 1 '^rhytid: error: --profile: got "/ligaments/stiffness", expected all, or what is fitted, /colliders' \
  fit case.json -o a --profile /ligaments/stiffness
expect 2 1 '/fit/profiles/0: got "/nothing", expected' fit case.json -o a --set '/fit/profiles=["/nothing"]'
expect 2 1 '^rhytid: error: --starts' fit case.json -o a --starts 0
expect 2 1 '/fit/starts: got 0, expected' fit case.json -o a --set /fit/starts=0
expect 2 1 '^rhytid: error: track: got neither a case nor --video, expected one of the two' track
expect 2 1 '^rhytid: error: nodir: got no folder there, expected the folder with the results of a fit' report nodir
mkdir -p a
expect 2 1 '^rhytid: error: a: got no fit.json in it, expected the folder with the results of a fit' report a
for verb in render track fit; do
  expect 2 1 '^rhytid: error: no.json: got no.json, which does not exist, expected a readable case file$' $verb no.json -o a
done
expect 2 1 'expected a readable experiment file$' study sweep no.json -o a
expect 2 1 '^rhytid: error: .*no.obj: got no file there, expected a readable mesh file \(.obj, .ply, .glb or .msh\)$' \
  check scene.json --set /skin/surface/grid=null --set /skin/surface/file=no.obj

for verb in render track fit; do
  expect 2 1 '^rhytid: error: scene.json: got a scene, expected a case, .* data/scenes/demo/case.json\)$' $verb scene.json -o a
done
expect 2 1 'got a value of the scene, .*: --set "/settings/1=/skin/order=3"$' fit case.json -o a --set /skin/order=3

expect 2 1 '^rhytid: error: --max-tracks' track case.json -o a --max-tracks=-7
expect 2 1 '^rhytid: error: --min-distance' track case.json -o a --min-distance 0.5
expect 2 1 '^rhytid: error: --window: got 20, expected an odd number of px from 7 to 201' track case.json -o a --window 20
expect 2 1 '^rhytid: error: --roi: got 0,0,0,0, expected' track case.json -o a --roi 0,0,0,0
expect 2 1 '^rhytid: error: --roi: got 0,0,1e\+12,1e\+12, expected .* from 0 to 100000' track case.json -o a --roi 0,0,1e12,1e12
expect 2 1 '^rhytid: error: --model' track case.json -o a --model rigid
expect 2 1 '^rhytid: error: --exposure' track case.json -o a --exposure 1.5
expect 2 1 '^rhytid: error: --exposure' render case.json -o a --exposure -0.5
expect 2 1 '^rhytid: error: --exposure: got nan, expected a number from 0 to 1' render case.json -o a --exposure nan
expect 2 1 '^rhytid: error: --exposure: got nan, expected a number from 0 to 1' track case.json -o a --exposure nan
expect 2 1 '/track/exposure: got 1.5, expected' track case.json -o a --set /track/exposure=1.5
expect 2 1 '/track/roi: got \[0.0,0.0,0.0,5.0\], expected' track case.json -o a --set '/track/roi=[0, 0, 0, 5]'

# The main job, tracking included.
expect 0 0 '^a/footage.avi: 5 frames at 20 Hz, 160 x 120 px' render case.json -o a
written a footage.avi camera.yaml truth.json truth_tracks.csv truth_motion.bin frame_0000.png
expect 0 0 'no tracks yet \(a/tracks.csv\): tracking a/footage.avi first' fit case.json -o a
grep -q '^against the truth: ' out.txt || fail "tracking inside fit: $(cat out.txt)"
grep -qE '^Status: converged after [0-9]+ forward runs' out.txt || fail "fit: $(cat out.txt)"
grep -qE '^finger friction coefficient .* 0\.8 +[-+][0-9.]+ +(yes|no)$' out.txt || fail "no truth in the answer: $(cat out.txt)"
written a tracks.csv overlay.png track.json fit.json residuals.csv fitted_scene.json answer.txt report.html
grep -q '</html>' a/report.html || fail "report.html is not whole"
chi=$(python3 -c 'import json; print(json.load(open("a/fit.json"))["reduced_chi_square"])')
echo "reduced chi-square $chi"

# A finger that never touches tells nothing: an answer says so.
mkdir lifted && cp a/{footage.avi,camera.yaml,tracks.csv,track.json} lifted
expect 0 0 'not determined: changing it changes no tracked feature' fit case.json -o lifted \
  --set /settings/1=/colliders/finger/path/1/position/2=3 --set /settings/2=/colliders/finger/path/2/position/2=3
[ -s lifted/fit.json ] || fail "a fit that tells nothing left no fit.json"

# The other optimiser ends where the first does.
mkdir n && cp a/{footage.avi,camera.yaml,truth.json,tracks.csv} n
expect 0 0 '^Status: converged after [0-9]+ forward runs' fit case.json -o n --optimiser nlopt
python3 - <<'PYTHON' || fail "nlopt and ceres differ"
import json
ceres, nlopt = (json.load(open(folder + "/fit.json")) for folder in "an")
assert ceres["optimiser"].startswith("ceres") and nlopt["optimiser"].startswith("nlopt"), nlopt["optimiser"]
assert abs(nlopt["final_cost"] / ceres["final_cost"] - 1) < 1e-6, (nlopt["final_cost"], ceres["final_cost"])
values = [fit["parameters"][0]["value"] for fit in (ceres, nlopt)]
print("ceres, nlopt:", values, ceres["forward_runs"], nlopt["forward_runs"], "runs")
assert abs(values[1] / values[0] - 1) < 1e-3, values
PYTHON

# Without H.264: said before anything is simulated, and the overlay takes Motion JPEG.
export OPENCV_VIDEOIO_PRIORITY_FFMPEG=0
expect 2 1 '^rhytid: error: j/footage.mp4: got no working encoder for h264, expected .*, or /render/codec mjpg$' \
  render case.json -o j --set /render/codec=h264
[ ! -e j ] || fail "a refused render left $(ls j)"
mkdir j && cp a/{footage.avi,camera.yaml} j
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o j
expect 0 0 'blur of a shutter open for 0.50 of the frame interval' track --video a/footage.avi --exposure 0.5 -o shutter
unset OPENCV_VIDEOIO_PRIORITY_FFMPEG
written j overlay.avi overlay.png

# Tracks are those of the footage and of what the case asks, or made again; never so over what was asked by hand.
mkdir c && cp a/{camera.yaml,tracks.csv,track.json} c && cp a/footage.avi A.avi
few() { expect 3 0 "$1" fit case.json -o c --max-evaluations 1 "${@:2}"; }
few 'cost' --set /footage=A.avi
grep -q tracking err.txt && fail "valid tracks were not taken: $(cat err.txt)"
python3 - <<'PYTHON'
import json
record = json.load(open("c/track.json"))
del record["settings"]["exposure"], record["case_settings"]["exposure"]  # of a program that did not know of it
json.dump(record, open("c/track.json", "w"))
PYTHON
few 'cost' --set /footage=A.avi
grep -q tracking err.txt && fail "tracks of an earlier program were not taken: $(cat err.txt)"
few 'c/tracks.csv is made with other exposure: tracking A.avi again' --set /footage=A.avi --set /track/exposure=0
few 'c/tracks.csv is made with other exposure, max_tracks: tracking A.avi again' --set /footage=A.avi --set /track/max_tracks=10
few 'is made with other max_tracks, roi:' --set /footage=A.avi --set '/track/roi=[0, 0, 159, 119]'
few 'is made with other masks of skin and finger, roi:' --set /footage=A.avi --set /track/mask_finger=false
few 'is made with other masks of skin and finger:' --set /footage=A.avi
sed 's/^name:.*/name: "other"/' a/camera.yaml >c/camera.yaml
few 'c/tracks.csv is made with other camera: tracking A.avi again' --set /footage=A.avi
echo '{"unfinished": true}' >c/track.json
few 'c/tracks.csv is not finished: tracking A.avi again' --set /footage=A.avi
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o c --set /footage=A.avi --model translation --max-tracks 12
cp c/tracks.csv by_hand.csv
few 'cost' --set /footage=A.avi
few 'cost' --set /footage=a/footage.avi
expect 2 1 '^rhytid: error: c/tracks.csv: got tracks made with other model, expected those of the case' \
  fit case.json -o c --set /footage=A.avi --set /track/model=translation
cmp c/tracks.csv by_hand.csv || fail "tracks made by hand were written over"
rm c/track.json
few 'cost' --set /footage=A.avi --set /track/model=translation
grep -q tracking err.txt && fail "tracks without a record were not taken: $(cat err.txt)"
# What track.json says is written as soon as the tracks are there.
mkdir -p cut/overlay.mp4 cut/overlay.avi
"$program" track case.json -o cut --video A.avi --threads 1 >out.txt 2>err.txt && fail "an overlay over a folder"
grep -q '"by_hand": true' cut/track.json || fail "tracks without their record: $(cat cut/track.json err.txt)"
# Stills have a digest too.
mkdir stills && for i in 0 1 2; do cp a/frame_0000.png stills/f_$i.png; done
expect 0 0 'tracks.csv: 3 of 3 frames' track -o still --video 'stills/f_%d.png'
grep -q '"digest": "[0-9a-f]*"' still/track.json || fail "no digest of stills: $(cat still/track.json)"

# A render that is interrupted leaves footage and camera of before.
cp a/camera.yaml camera_before.yaml && mkdir r && cp a/{footage.avi,camera.yaml,truth.json,truth_motion.bin} r
"$program" render case.json -o r --threads 1 --set '/render/tilt="35 deg"' --set /render/supersampling=8 >out.txt 2>err.txt &
pid=$!
for _ in $(seq 3000); do [ -e r/frame_0000.png ] && break; sleep 0.01; done
kill -INT $pid
wait $pid
code=$?
[ "$code" = 4 ] || fail "interrupted render: exit $code: $(cat err.txt)"
cmp r/camera.yaml camera_before.yaml && cmp r/footage.avi a/footage.avi || fail "an interrupted render mixed footage and camera"
[ ! -e r/truth.json ] || fail "truth beside footage that it may not belong to"

# Killed in the middle, it goes on after the last completed run and ends at the same bits.
mkdir b && cp a/{footage.avi,camera.yaml,truth.json,tracks.csv} b
"$program" fit case.json -o b --threads 1 >out.txt 2>err.txt &
pid=$!
for _ in $(seq 3000); do [ "$(ls b/evaluations 2>/dev/null | grep -c '^run-[0-9]*\.bin$')" -ge 2 ] && break; sleep 0.01; done
kill -9 $pid 2>/dev/null || fail "the fit was over before it could be killed"
wait $pid 2>/dev/null
[ ! -e b/fit.json ] || fail "the fit was over before it could be killed"
expect 0 0 'resumed: [0-9]+ runs of an earlier start are in b/evaluations' fit case.json -o b
grep -qE 'run 2 \([0-9.]+ s then\)' err.txt || fail "runs were not taken from the log: $(cat err.txt)"
record a >a.txt && record b >b.txt && cmp a.txt b.txt || fail "the resumed fit differs: $(diff a.txt b.txt | head)"

# An address by number is the case's parameter with its bounds, and the same fit; another one sets the log aside.
expect 3 0 'run 1 \([0-9.]+ s then\)' \
  fit case.json -o b --parameters /colliders/0/friction/coefficient --max-evaluations 1
grep -q '"address": "/colliders/finger/friction/coefficient"' b/fit.json && grep -q '"lower": 0.125' b/fit.json ||
  fail "an address by number lost its bounds"

# What --set changes reaches the record and the report, from any working directory.
expect 3 0 'evaluations of an earlier fit \(other scene\) are set aside in b/evaluations.old' \
  fit case.json -o b --max-evaluations 1 \
  --set '/settings/0=/skin/layers/skin/poissons_ratio=0.4'
grep -q '"poissons_ratio": 0.4,' b/fitted_scene.json || fail "fitted_scene.json does not have the setting"
grep -q '"tracks_file": "tracks.csv"' b/fit.json || fail "files of the folder are not named from it"
(cd / && "$program" report "$scratch/b" --threads 1 >"$scratch/out.txt" 2>"$scratch/err.txt") || fail "report: $(cat err.txt)"
grep -q 'No picture of the skin' b/report.html && fail "the report did not find its scene"

# A report that cannot be written leaves a finished fit.
rm -f a/fit.json a/report.html && mkdir a/report.html
expect 1 1 'error: the fit is complete, but its report could not be written: a/report.html' fit case.json -o a
record a >again.txt && cmp a.txt again.txt || fail "a finished fit changes when it is run again"
rmdir a/report.html

# The warp model, from the command line and from the case.
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o t --video a/footage.avi
cp t/tracks.csv affine.csv
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o t --video a/footage.avi --model translation
cp t/tracks.csv translation.csv
cmp -s affine.csv translation.csv && fail "--model changes nothing"
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o t --video a/footage.avi --set /track/model=translation
cmp -s t/tracks.csv translation.csv || fail "/track/model is not --model"
expect 0 0 'overlay.avi where' track --help

# Footage of another rate than the scene's.
mkdir -p rate && cp a/camera.yaml rate && python3 - <<'PYTHON'
lines = open("a/tracks.csv").read().splitlines()
names = next(l for l in lines if not l.startswith("#")).split(",")
out = []
for line in lines:
    cells = line.split(",")
    if cells != names and not line.startswith("#"):
        cells[names.index("time_s")] = repr(int(cells[names.index("frame")]) / 21)
    out.append(",".join(cells))
open("rate/tracks.csv", "w").write("\n".join(out) + "\n")
PYTHON
"$program" fit case.json -o rate --threads 1 >out.txt 2>err.txt
[ $? = 2 ] && grep -q "/time/frame_rate is 20 1/s, the footage's about 21 1/s$" err.txt || fail "another frame rate: $(cat err.txt)"

# Truth belongs to the rendered footage alone.
expect 0 0 '^against the truth: .* reduced chi-square for a fit [0-9.]+' track case.json -o a
cp a/footage.avi other.avi
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o a --video other.avi
grep -q 'against the truth' out.txt && fail "another video was compared with the truth"

expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o a

# Other footage under the same name: its tracks are made again, and compared with its own truth.
expect 0 0 '^a/footage.avi: 5 frames' render case.json -o a --set '/truth/settings/0=/colliders/finger/friction/coefficient=0.3'
expect 0 0 'a/tracks.csv is of other footage: tracking a/footage.avi again' fit case.json -o a
grep -qE '^finger friction coefficient .* 0\.3 +[-+][0-9.]+ +(yes|no)$' out.txt || fail "not the new truth: $(cat out.txt)"
python3 - <<'PYTHON' || fail "the fit did not see the new footage"
import json
value = json.load(open("a/fit.json"))["parameters"][0]["value"]
raise SystemExit(not 0.2 < value < 0.45)
PYTHON
cp a/footage.avi a/new.avi && cp other.avi a/footage.avi
expect 0 0 'a/truth.json is the truth of other footage: not compared' fit case.json -o a

# The same under another name.
cp a/new.avi B.avi && rm -rf c/tracks.csv
few 'no tracks yet' --set /footage=A.avi
few 'c/tracks.csv is of other footage: tracking B.avi again' --set /footage=B.avi
expect 0 0 'tracks.csv: 5 of 5 frames' track case.json -o c --video A.avi
expect 2 1 '^rhytid: error: c/tracks.csv: got tracks of other footage, expected those of the case' \
  fit case.json -o c --set /footage=B.avi

# Stopped by the user: what an earlier fit found stays.
cp a/fit.json before.json
"$program" fit case.json -o a --anew --threads 1 >out.txt 2>err.txt &
pid=$!
for _ in $(seq 3000); do grep -q '^run 1' err.txt && break; sleep 0.01; done
kill -INT $pid
wait $pid
code=$?
[ "$code" = 4 ] || fail "interrupted fit: exit $code: $(cat err.txt)"
cmp a/fit.json before.json || fail "an interrupted fit wrote over an answer"
grep -q 'stopped after [0-9]* forward runs' err.txt || fail "no word about stopping: $(cat err.txt)"
[ "$(grep -c 'failed' err.txt)" = 0 ] || fail "runs that were not made are called failed: $(cat err.txt)"
exit $((failures > 0))
