#!/bin/bash
# The scripts of tools/ on a copy of them: --help prints and does nothing else, what they do not know is refused before
# anything is done, and a demo that is finished is not done again.
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

# The demo over stand-ins for the build and the program.
mkdir -p build/release/bin
printf '#!/bin/bash\n' >tools/build
cat >build/release/bin/rhytid <<'PROGRAM'
#!/bin/bash
# VERB case.json -o FOLDER
mkdir -p "$4" && echo "$1" >>calls.txt
case $1 in
  render) touch "$4"/{truth.json,camera.yaml} && echo 1 >"$4/truth_tracks.csv" ;;
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
sleep 0.02 && touch data/scenes/demo/scene.json
tools/demo >out.txt 2>&1
[ "$(called)" = "render track fit " ] || fail "a changed scene does not start the demo over"
exit $((failures > 0))
