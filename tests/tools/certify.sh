#!/bin/bash
# rhytid certify on a small scene with contact, slip and viscosity: certified, files written, bad input refused.
#   certify.sh PROGRAM
set -u
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat >"$folder/scene.json" <<'SCENE'
{
  "name": "press",
  "skin": {
    "surface": {"grid": {"size": ["12 mm", "8 mm"], "cells": [3, 2]}},
    "order": 2,
    "layers": [{"name": "soft", "thickness": "1.5 mm", "order": 1, "youngs_modulus": "20 kPa"}]
  },
  "base": {"shape": "plane", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm"},
  "colliders": [
    {"name": "finger", "shape": "sphere", "radius": "5 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
     "friction": {"coefficient": 0.4, "slip_speed": "2 mm/s"},
     "path": [{"time": 0, "position": [-1, 0, 5.02]}, {"time": 0.1, "position": [-1, 0, 4.6]},
              {"time": 1, "position": [4, 1, 4.6]}]}
  ],
  "time": {"frame_rate": "24 Hz", "frames": 5}
}
SCENE

failures=0
# expect CODE ARGUMENTS...
expect() {
  local code=$1
  shift
  "$program" certify "$@" >"$folder/out" 2>"$folder/err"
  local actual=$?
  [ "$actual" = "$code" ] && return
  echo "FAILED: certify $*: exit $actual, expected $code"
  cat "$folder/out" "$folder/err"
  failures=$((failures + 1))
}

expect 0 "$folder/scene.json" -o "$folder/a" --parameters /skin/layers/soft/youngs_modulus,/base/stiffness --thorough
cmp "$folder/out" "$folder/a/certificate.txt" || failures=$((failures + 1))
grep -q '"passed": true' "$folder/a/certificate.json" || { echo "FAILED: certificate.json"; failures=$((failures + 1)); }
# Figures with their digits, limits with their direction: 1.97 near 2, 0.4 >= 0.1.
grep -qE '^pass +Taylor slope, joint, random +(1\.9[5-9][0-9]*|2|2\.0[0-9]*) +near 2$' "$folder/out" || { echo "FAILED: slope"; cat "$folder/out"; failures=$((failures + 1)); }
grep -qE '^pass +pivots +[0-9.]+ +>= 0\.1$' "$folder/out" || { echo "FAILED: pivots"; failures=$((failures + 1)); }
grep -q 'Taylor slope, soft youngs_modulus' "$folder/out" || { echo "FAILED: --thorough"; failures=$((failures + 1)); }
grep -q '>certified' "$folder/a/certificate.html" || { echo "FAILED: certificate.html"; failures=$((failures + 1)); }
# No viscosity: its time has no effect, so there is nothing to certify.
expect 3 "$folder/scene.json" -o "$folder/b" --set /skin/layers/soft/relaxing_fraction=0 \
  --parameters /skin/layers/soft/relaxation_time
grep -q '>FAIL<' "$folder/b/certificate.html" || { echo "FAILED: certificate.html of a failed check"; failures=$((failures + 1)); }
# The step is not solved within one iteration: no run, no gradient.
expect 3 "$folder/scene.json" -o "$folder/c" --set /solver/max_iterations=1 --set /time/max_bisections=0
expect 2 "$folder/scene.json" -o "$folder/d" --parameters /skin/layers/soft/youngs_modulos
# The finger comes a little earlier: first order of a loose run's error cancels by chance, a tighter one decides.
sed 's/"time": 0,/"time": -0.01,/; s/"time": 0.1,/"time": 0.09,/; s/"time": 1,/"time": 0.99,/' "$folder/scene.json" \
  >"$folder/earlier.json"
expect 0 "$folder/earlier.json" -o "$folder/e" --parameters /skin/layers/soft/youngs_modulus
grep -q 'at tolerance 1e-04 the functional' "$folder/out" || { echo "FAILED: a second loose run"; failures=$((failures + 1)); }
exit $((failures > 0))
