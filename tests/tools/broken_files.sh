#!/bin/bash
# Files that are broken, missing or of something else, and disks that are full: one clear line, the exit code of the guide,
# and what was there before stays.
#   broken_files.sh PROGRAM KILL_TEST SCRATCH_FOLDER      KILL_TEST: kill_test.py, whose tiny case is used
set -u
program=$(realpath "$1") kill_test=$(realpath "$2") scratch=$(realpath -m "$3")
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }
rm -rf "$scratch" && mkdir -p "$scratch" && cd "$scratch" || exit 1
python3 - "$kill_test" <<'PYTHON' || exit 1
import importlib.util, pathlib, sys
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("kill_test", sys.argv[1])
kill_test = importlib.util.module_from_spec(spec)
spec.loader.exec_module(kill_test)
for name, text in (("scene.json", kill_test.SCENE), ("case.json", kill_test.CASE)):
    pathlib.Path(name).write_text(text)
PYTHON

# expect CODE PATTERN ARGUMENTS...: exactly one line with "error:" when the code is 1 or 2, and it has PATTERN; no
# temporary names left.
expect() {
  local code=$1 pattern=$2 actual
  shift 2
  "$program" "$@" --threads 1 >out.txt 2>err.txt
  actual=$?
  [ "$actual" = "$code" ] || fail "$*: exit $actual, expected $code: $(tail -3 err.txt)"
  if [ "$code" != 0 ]; then
    [ "$(grep -c 'error: ' err.txt)" = 1 ] || fail "$*: not one error: $(cat err.txt)"
    grep 'error: ' err.txt | grep -qE -- "$pattern" || fail "$*: no '$pattern' in: $(cat err.txt)"
  else
    cat out.txt err.txt | grep -qE -- "$pattern" || fail "$*: no '$pattern' in: $(cat out.txt err.txt)"
  fi
  [ -z "$(find . -name '*.tmp-*')" ] || fail "$*: left behind: $(find . -name '*.tmp-*')"
}
contents() { (cd "$1" && find . -type f | sort | xargs md5sum); }

expect 0 'footage.avi: 5 frames' render case.json -o a
expect 0 'Status: ' fit case.json -o a
contents a >before.txt
unchanged() { contents a | cmp -s - before.txt || fail "$*: what was there changed: $(contents a | diff - before.txt | head -4)"; }

# Footage that is none, is cut off, or is gone.
echo "no video" >text.avi
: >empty.avi
head -c 30000 a/footage.avi >cut.avi
mkdir folder.avi
for video in text.avi empty.avi folder.avi none.avi; do
  expect 2 "$video" track case.json -o a --video $video
done
unchanged "unreadable video"
mkdir cut && cp a/camera.yaml cut
"$program" track case.json -o cut --video cut.avi --threads 1 >out.txt 2>err.txt
code=$?
case $code in
  0) grep -q 'warning: cut.avi ended after [0-9]* of 5 frames' err.txt || fail "a cut video is not said to be: $(cat err.txt)" ;;
  2) [ "$(wc -l <err.txt)" = 1 ] || fail "a cut video: $(cat err.txt)" ;;
  *) fail "a cut video: exit $code: $(cat err.txt)" ;;
esac
mkdir stills && for i in 0 2 3; do cp a/frame_0000.png stills/f_$i.png; done
expect 2 'stills/f_' track -o gap --video 'stills/f_%d.png'
echo broken >stills/f_1.png
expect 2 'stills/f_1.png' track -o gap --video 'stills/f_%d.png'
[ ! -e gap/tracks.csv ] || fail "tracks of broken stills"

# Numbers that are none, and tables that are cut off.
mkdir n && cp a/camera.yaml a/footage.avi n
for word in nan NaN inf -inf 1e999 x ''; do
  awk -F, -v OFS=, -v w="$word" '/^#/ || $1 == "frame" { print; next } !done && $11 == "ok" { $5 = w; done = 1 } { print }' a/tracks.csv >n/tracks.csv
  expect 2 "n/tracks.csv:[0-9]+:" fit case.json -o n
done
awk -F, -v OFS=, '!done && $11 == "ok" { $7 = -1; done = 1 } { print }' a/tracks.csv >n/tracks.csv
expect 2 'n/tracks.csv:[0-9]+.*expected a positive variance' fit case.json -o n
head -c $(($(wc -c <a/tracks.csv) - 5)) a/tracks.csv >n/tracks.csv
expect 2 'n/tracks.csv:[0-9]+' fit case.json -o n
: >n/tracks.csv
expect 2 'n/tracks.csv' fit case.json -o n
[ ! -e n/fit.json ] || fail "a fit of broken tracks"

# A mesh that is not that of the run, and one that is broken.
expect 0 'written to' simulate scene.json -o run --set /time/frames=2
expect 2 'run/state.bin: got the state of a different scene' simulate scene.json -o run --resume --set '/skin/surface/grid/cells=[5, 3]'
printf 'v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n' >nan.obj
expect 2 'nan.obj' simulate scene.json -o mesh --set /skin/surface/grid=null --set /skin/surface/file=nan.obj
printf 'v 0 0 0\nv 1 0 0\nf 1 2 9\n' >index.obj
expect 2 'index.obj' simulate scene.json -o mesh --set /skin/surface/grid=null --set /skin/surface/file=index.obj

# State and log that are cut off: refused, or done again, and never taken for whole.
head -c 200 run/state.bin >state.bin && cp state.bin run/state.bin
expect 2 'run/state.bin' simulate scene.json -o run --resume
cp -r a b && for log in b/evaluations/*.bin; do head -c 40 "$log" >x && mv x "$log"; done
expect 0 'Status: ' fit case.json -o b
python3 - <<'PYTHON' || fail "a log that was cut off changed the answer"
import json
values = [[(p["value"], p["sigma"]) for p in json.load(open(f + "/fit.json"))["parameters"]] for f in "ab"]
raise SystemExit(values[0] != values[1])
PYTHON

# A disk that is full: files of at most 8 KiB, and where it may be mounted a small disk.
full() {
  local code=$1
  shift
  [ "$code" = 1 ] || [ "$code" = 2 ] || fail "$*: exit $code: $(tail -3 err.txt)"
  [ "$(grep -c 'error: ' err.txt)" = 1 ] || fail "$*: not one error: $(cat err.txt)"
}
mkdir limit && cp a/camera.yaml limit
(trap '' XFSZ; ulimit -f 8; "$program" render case.json -o limit --threads 1 >out.txt 2>err.txt)
full $? render at a limit
[ ! -e limit/footage.avi ] || fail "footage that was cut off by a limit"
if mkdir disk && mount -t tmpfs -o size=64k tmpfs disk 2>/dev/null; then
  trap 'umount "$scratch/disk"' EXIT
  "$program" simulate scene.json -o disk/run --threads 1 >out.txt 2>err.txt
  full $? simulate on a full disk
  rm -rf disk/*
  cp a/tracks.csv a/camera.yaml disk && head -c 1000000 /dev/zero >disk/fill 2>/dev/null
  "$program" fit case.json -o disk --threads 1 >out.txt 2>err.txt
  full $? fit on a full disk
  cmp -s a/tracks.csv disk/tracks.csv || fail "a fit on a full disk lost its tracks"
  rm disk/fill && mount -o remount,size=8m disk && rm -rf disk/evaluations
  expect 0 'Status: ' fit case.json -o disk
else
  echo "SKIPPED: a full disk, since none may be mounted here"
fi
exit $((failures > 0))
