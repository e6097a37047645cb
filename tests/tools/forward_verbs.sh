#!/bin/bash
# check, simulate and heatmap of a real program: exit codes, files, one line on errors.
#   forward_verbs.sh PROGRAM SOURCE_FOLDER SCRATCH_FOLDER
set -u
program=$1 source=$2 scratch=$3
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
rm -rf "$scratch" && mkdir -p "$scratch" && cd "$scratch" || exit 1

cat >tiny.json <<'SCENE'
{
  // A pressed and dragged patch, small enough for a second.
  "name": "tiny",
  "skin": {
    "surface": {"grid": {"size": [12, 10], "cells": [3, 2]}}, "order": 2,
    "layers": [{"name": "soft", "thickness": 1.5, "youngs_modulus": "20 kPa"}]
  },
  "ligaments": {"sources": [{"name": "a", "position": [-3, 0, -1.5], "strength": 1},
                            {"name": "b", "position": [3, 0, -1.5], "strength": 4}]},
  "base": {"shape": "plane"},
  "colliders": [{"name": "finger", "radius": 4, "friction": {"coefficient": 0.5},
                 "path": [{"time": 0, "position": [-1, 0, 4.01]}, {"time": 0.125, "position": [-1, 0, 3.7]},
                          {"time": 1, "position": [1, 0, 3.7]}]}],
  "time": {"frames": 4}
}
SCENE
small=(--threads 1 --picture-width 120 --subdivide 2)

# expect CODE LINES_ON_STDERR PATTERN ARGUMENTS...: PATTERN must occur in stdout and stderr together.
expect() {
  local code=$1 lines=$2 pattern=$3 actual
  shift 3
  "$program" "$@" >out.txt 2>err.txt
  actual=$?
  [ "$actual" = "$code" ] || fail "$*: exit $actual, expected $code: $(cat err.txt)"
  [ "$lines" = any ] || [ "$(wc -l <err.txt)" = "$lines" ] || fail "$*: $(wc -l <err.txt) lines on stderr: $(cat err.txt)"
  cat out.txt err.txt | grep -qE -- "$pattern" || fail "$*: no '$pattern' in: $(cat out.txt err.txt)"
}

# Whole files: valid JSON, XML, PNG signature, no temporary names left, series name existing files.
whole() {
  /usr/bin/env python3 - "$1" <<'PYTHON' || fail "files of $1"
import json, pathlib, sys, xml.etree.ElementTree as xml
folder = pathlib.Path(sys.argv[1])
run = json.loads((folder / "run.json").read_text())
rows = (folder / "steps.csv").read_text().splitlines() if (folder / "steps.csv").exists() else []
assert all(len(r.split(",")) == len(rows[0].split(",")) for r in rows), "ragged table"
for series in ("frames.pvd", "surface.pvd"):
    if (folder / series).exists():
        sets = xml.parse(folder / series).getroot().findall(".//DataSet")
        assert sets and all((folder / s.get("file")).stat().st_size > 0 for s in sets), series
for picture in folder.glob("pictures/*.png"):
    data = picture.read_bytes()
    assert data[:4] == b"\x89PNG" and b"IEND" in data[-12:], picture
known = {".vtu", ".vtp", ".pvd", ".png", ".json", ".csv", ".bin"}
strange = [p for p in folder.rglob("*") if p.is_file() and p.suffix not in known]
assert not strange, strange
print(run["exit"]["status"], run["progress"]["frames_done"], len(rows))
PYTHON
}

expect 0 0 '^  viscosity +left out: no layer relaxes$' check tiny.json --set /skin/layers/soft/relaxing_fraction=0
expect 0 0 '^  viscosity +nothing: 0 evaluations, 0 points, 0 numbers of history, 0 bytes$' \
  check tiny.json --set /skin/layers/soft/relaxing_fraction=0
expect 0 0 '^  viscosity +[1-9][0-9]* evaluations of [0-9]+ points, [1-9][0-9]* numbers of history, [0-9.]+ MB$' check tiny.json
expect 0 0 '^  residual at rest +0 N, exactly an equilibrium$' check tiny.json
expect 0 0 '^  pictures +about .* more: 2 of each of 5 frames' check tiny.json
expect 0 0 '^ +"unknowns": 180,$' check tiny.json --json
/usr/bin/env python3 -c 'import json; json.load(open("out.txt"))' || fail "check --json is not JSON"
expect 2 1 '^rhytid: error: no_such.json: got no_such.json, which does not exist, expected a readable scene or case file$' check no_such.json
expect 2 1 '^rhytid: error: tiny.json \(--set\): /skin/layers/soft/thicknes: got .*, nearest is "thickness"$' check tiny.json --set /skin/layers/soft/thicknes=1
expect 2 1 'elastic_patch/scene.json: /ligaments: got nothing, expected ligaments with at least one source$' heatmap "$source/data/scenes/elastic_patch/scene.json"
expect 2 1 '/skin/surface: got neither "file" nor "grid", expected one of the two, e.g. --set /skin/surface/file=PATH$' check "$source/data/scenes/head_forehead/scene.json"

expect 2 1 'youngs_modulus: got "1 MPA" \(MPA is no unit, MPa is one\), expected a pressure' check tiny.json --set '/skin/layers/soft/youngs_modulus=1 MPA'
expect 0 0 '^/skin/layers/soft/youngs_modulus +0\.02 +MPa +0\.0001 +1000 +log$' check tiny.json --parameters
expect 0 0 '"address": "/colliders/finger/friction/coefficient"' check tiny.json --parameters --json
# A case is taken for its scene, with its settings and those of the command line; two files of one name stay apart.
mkdir -p twin
cat >twin/case.json <<'CASE'
{"scene": "../tiny.json", "settings": ["/base/stiffness=2", "/skin/layers/soft/relaxing_fraction=0"],
 "fit": {"parameters": [{"address": "/base/stiffness"}]}}
CASE
expect 0 1 '^twin/case.json is a case: this is its scene .*/tiny.json, with 2 of its settings$' check twin/case.json
expect 0 1 '^  viscosity +left out: no layer relaxes$' check twin/case.json
expect 0 1 '^  viscosity +yes' check twin/case.json --set /settings/1=/base/stiffness=3
expect 0 1 '^  nodes +70 ' check twin/case.json --set /skin/layers/soft/order=1 --set /settings/2=/base/stiffness=3
expect 2 1 '--set "/settings/4=/base/stiffness=3": got item 4 of /settings, expected an item below 3$' check twin/case.json --set /settings/4=/base/stiffness=3
sed 's|/base/stiffness=2|/base/stifness=2|' twin/case.json >twin/wrong.json
expect 2 any '^rhytid: error: twin/wrong.json:1: /settings/0: /base/stifness: got .*, nearest is "stiffness"$' check twin/wrong.json
expect 2 1 "^rhytid: error: --output: got '/dev/null/x' .*, expected a folder that can be written$" simulate tiny.json -o /dev/null/x

expect 0 any '^written to run_a: run.json, steps.csv' simulate tiny.json -o run_a "${small[@]}"
[ "$(whole run_a)" = "complete 4 5" ] || fail "run_a: $(whole run_a)"
[ "$(ls run_a/frames run_a/surface run_a/pictures | grep -c frame_)" = 10 ] || fail "frames of run_a"
[ "$(ls run_a/pictures | wc -l)" = 10 ] || fail "pictures of run_a"

for python in /usr/bin/python3 python3; do
  "$python" "$source/tests/tools/read_series.py" run_a >vtk.txt 2>&1
  code=$?
  [ $code = 77 ] || break
done
[ $code = 77 ] && [ "${RHYTID_REQUIRE_CHECKS:-0}" = 0 ] && code=0
[ $code = 0 ] || fail "read back with VTK: $(cat vtk.txt)"

# Every second frame and the last; table and pictures off.
expect 0 any 'written to' simulate tiny.json -o run_b "${small[@]}" --set /time/frames=3 --set /output/every=2 \
  --set /output/pictures=false --set /output/csv=false
[ "$(ls run_b/frames | tr '\n' ' ')" = "frame_0000.vtu frame_0002.vtu frame_0003.vtu " ] || fail "every 2: $(ls run_b/frames)"
[ ! -e run_b/pictures ] && [ ! -e run_b/steps.csv ] || fail "run_b has files that the scene turned off"

# A shorter run into the same folder: no frame of the longer one stays, and nothing that is not a run's.
echo mine >run_a/notes.txt; echo mine >run_a/frames/frame_12.vtu; echo mine >run_a/pictures/shaded_0003.jpg
expect 0 any 'removed [0-9]+ files of an earlier run' simulate tiny.json -o run_a "${small[@]}" --set /time/frames=2 \
  --set /output/pictures=false
[ "$(ls run_a/frames | tr '\n' ' ')" = "frame_0000.vtu frame_0001.vtu frame_0002.vtu frame_12.vtu " ] ||
  fail "stale frames: $(ls run_a/frames)"
[ "$(ls run_a/pictures)" = shaded_0003.jpg ] || fail "stale pictures: $(ls run_a/pictures)"
[ "$(cat run_a/notes.txt run_a/frames/frame_12.vtu)" = "$(printf 'mine\nmine')" ] || fail "files of others in run_a"
mkdir -p foreign/frames && echo mine >foreign/frames/frame_0009.vtu
expect 2 1 'frame_0009.vtu in a folder without the run.json' simulate tiny.json -o foreign "${small[@]}"
[ "$(cat foreign/frames/frame_0009.vtu)" = mine ] && [ ! -e foreign/run.json ] || fail "a foreign folder was touched"

# Does not converge: one error line among the progress, partial results.
expect 3 any 'error: frame 1.*0 of 4 frames are kept' simulate tiny.json -o run_c "${small[@]}" \
  --set /solver/max_iterations=1 --set /time/max_bisections=0
[ "$(whole run_c)" = "not_converged 0 1" ] || fail "run_c: $(whole run_c)"

# Interrupted, then resumed to the same bits.
expect 0 any 'written to' simulate tiny.json -o run_d "${small[@]}" --set /time/frames=12
"$program" simulate tiny.json -o run_e "${small[@]}" --set /time/frames=12 >out.txt 2>err.txt &
pid=$!
for _ in $(seq 2000); do [ -e run_e/frames/frame_0002.vtu ] && break; sleep 0.02; done
kill -INT $pid
wait $pid
code=$?
[ "$code" = 4 ] || fail "interrupted run: exit $code: $(cat err.txt)"
case "$(whole run_e)" in interrupted\ [2-9]*) ;; *) fail "run_e: $(whole run_e)" ;; esac
expect 2 1 '^rhytid: error: run_e/state.bin: got the state of a different scene, ' simulate tiny.json -o run_e "${small[@]}" --resume --set /base/stiffness=2
expect 0 any 'resumed after frame [2-9]' simulate tiny.json -o run_e "${small[@]}" --resume --set /time/frames=12
[ "$(whole run_e)" = "complete 12 13" ] || fail "resumed run_e: $(whole run_e)"
for file in steps.csv frames.pvd surface.pvd state.bin frames/frame_0012.vtu surface/frame_0012.vtp; do
  cmp -s run_d/$file run_e/$file || fail "$file differs after a resume"
done
cp run_e/run.json before.json
expect 0 0 '^tiny: complete already, 12 frames in run_e; nothing was changed$' simulate tiny.json -o run_e "${small[@]}" --resume --set /time/frames=12
cmp -s before.json run_e/run.json || fail "resuming a complete run changed its record"
expect 0 any '^rhytid: warning: nothing to resume in run_f: the run starts from the beginning$' simulate tiny.json -o run_f "${small[@]}" --resume --set /output/pictures=false --set /time/frames=1
expect 0 any '^rhytid: warning: /time/frames: 0, ' simulate tiny.json -o run_f "${small[@]}" --set /output/pictures=false --set /time/frames=null --set /name=null
grep -q '^tiny: 0 frames' out.txt || fail "an unnamed scene has no name: $(cat out.txt)"

# A run that settled under its pre-stretch and is resumed does not settle a second time.
tense=(--set '/skin/pre_stretch={"stretch": 1.05}' --set /output/pictures=false)
expect 0 any 'written to' simulate tiny.json -o run_f "${small[@]}" "${tense[@]}"
expect 0 any 'written to' simulate tiny.json -o run_g "${small[@]}" "${tense[@]}" --set /time/frames=2
expect 0 any 'resumed after frame 2' simulate tiny.json -o run_g "${small[@]}" "${tense[@]}" --resume
for file in steps.csv state.bin frames/frame_0000.vtu frames/frame_0004.vtu; do
  cmp -s run_f/$file run_g/$file || fail "$file differs after a settled run was resumed"
done

expect 0 any 'b from 1(\.[0-9]+)? to [34](\.[0-9]+)? 1/mm' heatmap tiny.json -o heat --weights --threads 1
for file in heatmap.vtp heatmap.ply heatmap.csv heatmap.png weight_a.png weight_b.png; do
  [ -s heat/$file ] || fail "heatmap did not write $file"
done
expect 0 any '^rhytid: warning: ligament source b was moved by 30 mm to reach the inner surface$' heatmap tiny.json -o heat --threads 1 \
  --set '/ligaments/sources/b/position=[3, 0, -31.5]'
[ "$(ls heat)" = "$(printf 'heatmap.csv\nheatmap.ply\nheatmap.png\nheatmap.vtp')" ] || fail "shares of an earlier map stay: $(ls heat)"
expect 0 any '1/mm' heatmap tiny.json -o heat --weights --threads 1
head -1 heat/heatmap.csv | grep -q 'column,x_mm,y_mm,z_mm,b_per_mm,weight_a,weight_b' || fail "heatmap.csv header"
cat >experiment.json <<'EXPERIMENT'
{
  "scene": "tiny.json",
  "measure": {"line": {"from": [-5, 0, 0], "to": [5, 0, 0], "points": 50}},
  "variants": [{"name": "soft"}, {"name": "firm", "settings": ["/skin/layers/soft/youngs_modulus=60 kPa"]}]
}
EXPERIMENT
expect 2 1 "^rhytid: error: --only: got 'no', expected one of soft, firm$" study sweep experiment.json -o sweep/a --only no
[ ! -e sweep ] || fail "a refused sweep leaves a folder"
for verb in check simulate; do
  expect 2 1 '^rhytid: error: experiment.json: got an experiment, expected a scene or a case ' $verb experiment.json -o sweep
done
expect 2 1 '^rhytid: error: tiny.json: got a scene, expected an experiment, .*, or a scene with --grid or --csv$' study sweep tiny.json -o sweep
echo '{"scene": "tiny.json", "track": {}}' >a_case.json
expect 2 1 '^rhytid: error: a_case.json: got a case, expected an experiment, .*experiment.json\)$' study sweep a_case.json -o sweep
expect 0 any '^written to sweep: results.csv' study sweep experiment.json -o sweep --threads 1
[ "$(wc -l <sweep/results.csv)" = 3 ] || fail "rows of sweep/results.csv"
[ "$(ls sweep)" = "$(printf '%s\n' amplitude.svg crests.svg firm index.html profiles.svg results.csv results.md soft)" ] ||
  fail "files of sweep: $(ls sweep)"
expect 0 any 'firm: complete before, kept' study sweep experiment.json -o sweep --threads 1
expect 0 any 'firm: starts$' study sweep experiment.json -o sweep --threads 1 --anew --only firm
exit $((failures > 0))
