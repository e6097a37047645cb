#!/bin/bash
# calibrate and convert of the real program: exit codes, files, one line on bad input and nothing left behind.
#   footage_verbs.sh PROGRAM SCRATCH_FOLDER
set -u
program=$1 scratch=$2
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
rm -rf "$scratch" && mkdir -p "$scratch" && cd "$scratch" || exit 1

# Photographs of a board of 7 x 5 inner corners, 10 mm: a pinhole camera of 500 px, pictures of 320 x 240 px.
python3 - <<'PYTHON'
import math
def photograph(name, ax, ay, x, y, z):
    ca, sa, cb, sb = math.cos(ax), math.sin(ax), math.cos(ay), math.sin(ay)
    R = [[cb, 0, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]]
    m = (30, 20, 0)
    t = [c - sum(R[i][j] * m[j] for j in range(3)) for i, c in enumerate((x, y, z))]
    o = [-sum(R[i][j] * t[i] for i in range(3)) for j in range(3)]
    pixels = bytearray()
    for v in range(240):
        for u in range(320):
            grey = 0
            for dv in (-.25, .25):
                for du in (-.25, .25):
                    d = ((u + du - 160) / 500, (v + dv - 118) / 500, 1)
                    w = [sum(R[i][j] * d[i] for i in range(3)) for j in range(3)]
                    s = -o[2] / w[2]
                    a, b = (o[0] + s * w[0]) / 10 + 1, (o[1] + s * w[1]) / 10 + 1
                    if not (-1 < a < 9 and -1 < b < 7): grey += 100
                    elif 0 < a < 8 and 0 < b < 6 and (int(a) + int(b)) % 2 == 0: grey += 30
                    else: grey += 230
            pixels.append(grey // 4)
    open(name, "wb").write(b"P5 320 240 255\n" + bytes(pixels))
for i, pose in enumerate([(.5, 0, -10, 0, 200), (-.5, .1, 10, -5, 190), (0, .5, -12, 8, 210), (.1, -.5, 12, 6, 200),
                          (.35, .35, 0, -8, 180), (-.35, .35, 0, 6, 220)]):
    photograph(f"b{i}.pgm", *pose)
open("empty.pgm", "wb").write(b"P5 320 240 255\n" + bytes([90]) * 76800)
open("text.jpg", "w").write("no picture")
PYTHON

# expect CODE PATTERN ARGUMENTS...: PATTERN in stdout or stderr; one line of stderr when the code is 2.
expect() {
  local code=$1 pattern=$2 actual
  shift 2
  "$program" "$@" --threads 1 >out.txt 2>err.txt
  actual=$?
  [ "$actual" = "$code" ] || fail "$*: exit $actual, expected $code: $(cat err.txt)"
  [ "$code" != 2 ] || [ "$(grep -c 'error: ' err.txt)" = 1 ] || fail "$*: not one error: $(cat err.txt)"
  cat out.txt err.txt | grep -qE -- "$pattern" || fail "$*: no '$pattern' in: $(cat out.txt err.txt)"
}
# written FOLDER FILE...: all there, not empty, and nothing else.
written() {
  local folder=$1
  shift
  [ "$(ls "$folder" | tr '\n' ' ')" = "$(printf '%s\n' "$@" | sort | tr '\n' ' ')" ] || fail "$folder has $(ls "$folder")"
  for file in "$@"; do [ -s "$folder/$file" ] || fail "$folder/$file is empty"; done
}

expect 2 '^rhytid: error: missing.jpg: got no such file, expected a photograph$' calibrate missing.jpg -o x
expect 2 'error: text.jpg: got no picture' calibrate b0.pgm text.jpg -o x
expect 2 'error: calibrate: got 1 photograph with a board, expected at least 3' calibrate b0.pgm --board 7x5 -o x
expect 2 'error: --board: got no board of 8 x 6 inner corners in 2 photographs; b0.pgm shows one of 7 x 5, expected' \
  calibrate b0.pgm b1.pgm --board 8x6 -o x
expect 2 "error: --board: got '7', expected" calibrate b0.pgm --board 7 -o x
expect 2 'error: --square: got nothing' calibrate b0.pgm --extrinsic b1.pgm -o x
expect 2 "error: --square: got '?-3'?, expected" calibrate b0.pgm --square=-3 -o x
expect 2 'error: empty.pgm: got this photograph twice' calibrate empty.pgm empty.pgm -o x
expect 2 'error: calibrate: got no checkerboard in 1 photograph' calibrate empty.pgm -o x
expect 2 'photographs' calibrate -o x
[ ! -e x ] || fail "refused commands left $(ls x)"

expect 0 'empty.pgm is left out: no board of 7 x 5' calibrate b?.pgm empty.pgm --square 10 --extrinsic b0.pgm -o c
grep -qE '^photographs +6 of 7 used, 320 x 240 px' out.txt || fail "photographs: $(cat out.txt)"
written c camera.yaml calibration.json calibration.svg
python3 - <<'PYTHON' || fail "the camera is not what it was: $(cat out.txt)"
import json
c = json.load(open("c/calibration.json"))
p = c["parameters"]
for name, exact, most in (("fx", 500, 5), ("fy", 500, 5), ("cx", 160, 3), ("cy", 118, 3)):
    print(name, p[name]["value"], p[name]["interval_95"])
    assert abs(p[name]["value"] - exact) < most, name
assert c["rms_px"] < 0.25 and [q["used"] for q in c["photographs"]] == [True] * 6 + [False]
PYTHON
grep -qE 'origin at pixel \([0-9.]+, [0-9.]+\), camera (19|20|21)[0-9]\.[0-9] mm from it' out.txt || fail "extrinsic: $(cat out.txt)"
# Names of files need not be UTF-8.
cp b0.pgm $'fl\xfcgel.pgm'
expect 0 '^written: l/camera.yaml' calibrate b[1-5].pgm $'fl\xfcgel.pgm' --board 7x5 -o l
written l camera.yaml calibration.json calibration.svg
python3 -c 'import json; json.load(open("l/calibration.json", encoding="utf-8")); open("l/calibration.svg", encoding="utf-8").read()' ||
  fail "calibration.json or calibration.svg is not UTF-8"

# Tracks.
head='SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,GAMMA,STATUS_FLAG'
printf '***\n%s\n3,10,20,0.5,0,0.02,0.01,0\n4,30,20,0,0,-1,-1,8\n' $head >d_1.txt
printf '***\n%s\n3,10,20,1.5,0,0.02,0.01,0\n4,30,20,2,0,0.02,0.01,4\n' $head >d_2.txt
expect 2 'error: --rate: got nothing' convert d_1.txt d_2.txt -o t
expect 2 'error: nothing.csv' convert nothing.csv -o t
expect 2 "error: --camera: got '', expected a camera's name" convert d_1.txt d_2.txt --rate 25 --camera '' -o t
sed 's/0.5,0,/half,0,/' d_1.txt >bad_1.txt
expect 2 "error: bad_1.txt:3:9: got DISPLACEMENT_X 'half', expected a number" convert bad_1.txt --rate 25 -o t
[ ! -e t ] || fail "refused commands left $(ls t)"
expect 0 '^t/tracks.csv: 2 tracks from 2 files \(dice\), frames 0 to 2, 3 of 4 observations ok' convert d_2.txt d_1.txt --rate 25 -o t
grep -q '^lost: 1 STATUS_FLAG 8$' out.txt || fail "lost: $(cat out.txt)"
written t tracks.csv
grep -qE '^2,0.08,3,camera,11.5,20,2e-04,0,2e-04,0.995,ok$' t/tracks.csv || fail "tracks: $(cat t/tracks.csv)"
grep -q '^1,0.04,4,camera,,,,,,,lost$' t/tracks.csv || fail "lost: $(cat t/tracks.csv)"
expect 2 'error: --to: got nothing, expected opencorr' convert t/tracks.csv -o back
expect 0 'DICe_solution_0001.txt ... DICe_solution_0002.txt: 2 tracks' convert t/tracks.csv --to dice -o back
expect 0 'tracks.csv: 2 tracks' convert back/*.txt --rate 25 -o again
cmp again/tracks.csv t/tracks.csv || fail "there and back: $(diff again/tracks.csv t/tracks.csv)"
expect 2 'error: --sigma: got nothing' convert t/tracks.csv --to opencorr --from opencorr -o back2

# Cameras.
echo '{"skin": {"surface": {"grid": {"size": [8, 6], "cells": [2, 2]}}, "layers": [{"name": "a", "thickness": 1, "youngs_modulus": 0.05}]}, "time": {"frames": 1}}' >scene.json
mkdir sparse
echo '1 PINHOLE 320 240 500 500 160.5 118.5' >sparse/cameras.txt
printf '1 1 0 0 0 0 0 2 1 a.jpg\n\n2 1 0 0 0 0 0 3 1 b.jpg\n\n' >sparse/images.txt
expect 2 'error: --mm-per-unit: got nothing' convert sparse --image a.jpg -o k
expect 2 'error: sparse/images.txt: got 2 images, expected the name of one' convert sparse --mm-per-unit 10 -o k
expect 2 "no image 'c.jpg'" convert sparse --image c.jpg --mm-per-unit 10 -o k
echo '{"scene": "scene.json", "camera": "sparse", "camera_image": "b.jpg"}' >case.json
expect 2 'error: case.json: /camera_unit: got nothing, expected the length of COLMAP' track case.json --video none.avi -o k
[ ! -e k ] || fail "refused commands left $(ls k)"
expect 0 'k/camera.yaml: 320 x 240 px, at \(0.0, 0.0, -30.0\) mm' convert sparse --image b.jpg --mm-per-unit 10 -o k
grep -q '160., 0., 500., 118.' k/camera.yaml || fail "half a pixel: $(cat k/camera.yaml)"
expect 2 'error: --to: got nothing, expected colmap' convert k/camera.yaml -o k2
expect 0 'k2/cameras.txt, images.txt: 1 camera' convert k/camera.yaml --to colmap --mm-per-unit 10 -o k2
grep -q '^1 PINHOLE 320 240 500 500 160.5 118.5$' k2/cameras.txt || fail "cameras.txt: $(cat k2/cameras.txt)"

[ "$failures" = 0 ] && echo "calibrate and convert: all as expected" && exit 0
exit 1
