#!/bin/bash
# rhytid bench on its smallest patch: tables with the figures that must hold on any machine, bad input refused.
#   bench.sh PROGRAM
set -u
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failures=0
fail() {
  echo "FAILED: $*"
  cat "$folder/out" "$folder/err"
  failures=$((failures + 1))
}
# expect CODE ARGUMENTS...
expect() {
  local code=$1
  shift
  "$program" bench "$@" >"$folder/out" 2>"$folder/err"
  local actual=$?
  [ "$actual" = "$code" ] || fail "bench $*: exit $actual, expected $code"
}
# column FILE NAME: the values of a column of a CSV file whose quoted cells have one comma at most.
column() {
  sed 's/"\([^",]*\),\([^",]*\)"/\1\2/g' "$1" |
    awk -F, -v name="$2" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) c = i; next } { print $c }'
}
small=(--nodes 600 --frames 7)

expect 0 stages "${small[@]}" --seconds 0 -o "$folder/stages"
grep -q '^patch_600,.*,factorisation,' "$folder/stages/stages.csv" || fail "stages.csv has no factorisation"
column "$folder/stages/stages.csv" time_ms | awk '!($1 > 0) { bad = 1 } END { exit bad || NR < 20 }' || fail "times of stages"
# A profile: a step has factors, the last of them the certificate, but fewer than iterations, since some keep the factor;
# factors and skin have a distance to their limits. Factors in single precision are all a forward run needs, nearly always.
expect 0 stages "${small[@]}" --seconds 0 --set /solver/factor_precision=mixed -o "$folder/mixed"
calls() { grep -E "^scene|,$2,|,\"$2\"," "$folder/$1/stages.csv" >"$folder/row" && column "$folder/row" calls_per_step; }
awk -v f="$(calls stages factorisation)" -v s="$(calls stages factorisation.*single)" -v i="$(calls stages 'feasible step')" \
  'BEGIN { exit !(s == 0 && f >= 2 && f < i) }' || fail "calls in a step"
awk -v f="$(calls mixed factorisation)" -v s="$(calls mixed factorisation.*single)" -v i="$(calls mixed 'feasible step')" \
  'BEGIN { exit !(s >= 1 && s < i && f < 1) }' || fail "calls in a step, mixed"
column "$folder/stages/stages.csv" share_of_fma_peak_one_thread | awk '$1 > 0 { n++ } END { exit n < 3 }' || fail "shares of the peak"
[ -s "$folder/stages/patch_600.json" ] || fail "the patch is not kept"

# Kernels and their plain references are the same sums, and not the same code.
expect 0 kernels --cells 1 --seconds 0 -o "$folder/kernels"
column "$folder/kernels/kernels.csv" difference |
  awk '!($1 < 1e-10) { bad = 1 } $1 > 0 { differ = 1 } END { exit bad || !differ || NR < 17 }' || fail "kernels and plain references"
column "$folder/kernels/kernels.csv" time_per_point_ns | awk '!($1 > 0) { exit 1 }' || fail "times of kernels"
# (Sums over all nodes would take 36 operations per node and point, P4 x P2 has 45 nodes; one direction at a time
# they take fewer, and the law takes some hundreds.)
grep '^skin: residual,P4 x P2,baseline,' "$folder/kernels/kernels.csv" | head -1 >"$folder/row"
cat <(head -1 "$folder/kernels/kernels.csv") "$folder/row" >"$folder/one.csv"
column "$folder/one.csv" flops_per_point | awk '!($1 > 700 && $1 < 36 * 45 + 300) { exit 1 }' || fail "operations counted"

# Features cost nothing where they are not; the settling step of tension and substeps are steps.
expect 0 features --nodes 600 --frames 2 --repeats 1 --starts 1 -o "$folder/features"
features() { grep -c "^patch_600,$1" "$folder/features/features.csv"; }
[ "$(features .)" = 15 ] && [ "$(features 'without ligaments,.*ligaments')" = 1 ] && [ "$(features 'all features,.*ligaments')" = 0 ] ||
  fail "variants of features"
column "$folder/features/features.csv" steps | sort | uniq -c | awk '{ n[$2] = $1 } END { exit !(n[2] == 13 && n[3] == 1 && n[4] == 1) }' ||
  fail "steps of variants"
column "$folder/features/features.csv" states_MB | awk '$1 > 0 { n++; if (n == 1) less = $1; else more = $1 } END { exit !(n == 2 && more > 2 * less) }' ||
  fail "states kept"
[ "$(column "$folder/features/programs.csv" size_MB | wc -l)" -ge 1 ] || fail "programs"

expect 0 gradient "${small[@]}" --repeats 1 --parameters 5 -o "$folder/gradient"
[ "$(column "$folder/gradient/gradient.csv" columns)" = 5 ] || fail "columns of the Jacobian"
column "$folder/gradient/gradient.csv" duality | awk '!($1 < 1e-11) { exit 1 }' || fail "duality"

# Tighter is nearer, and the adjoint tells how far a loose run is off.
expect 0 tolerance "${small[@]}" --tolerances 1e-2,1e-8 -o "$folder/tolerance"
column "$folder/tolerance/tolerance.csv" gradient_error | awk 'NR == 1 { loose = $1 } NR == 2 { tight = $1 } END { exit !(tight < 1e-2 * loose) }' ||
  fail "a tight tolerance has no better gradient"
paste -d, <(column "$folder/tolerance/tolerance.csv" functional_error) <(column "$folder/tolerance/tolerance.csv" predicted_functional_error) |
  awk -F, 'NR == 1 { d = $1 - $2; e = $1; if (d < 0) d = -d; if (e < 0) e = -e; exit !(d < 0.3 * e) }' || fail "the error bar"

expect 0 memory "${small[@]}" -o "$folder/memory"
[ "$(column "$folder/memory/memory.csv" same_bits | grep -c yes)" = 5 ] || fail "bits of gradients within budgets"

# All minimisers end at the same states; what is stopped is a row, not a failure.
expect 0 minimisers --nodes 600 --frames 4 -o "$folder/minimisers"
[ "$(column "$folder/minimisers/minimisers.csv" outcome | grep -cx complete)" = 4 ] || fail "outcomes of minimisers"
column "$folder/minimisers/minimisers.csv" largest_displacement_difference_mm |
  awk 'NR > 1 && !($1 > 0 && $1 < 1e-6) { bad = 1 } END { exit bad || NR != 4 }' || fail "minimisers differ"
[ "$(column "$folder/minimisers/minimisers_frames.csv" frame | sort | uniq -c | tr -s ' ')" = "$(printf ' 4 %d\n' 1 2 3 4)" ] || fail "frames of minimisers"
column "$folder/minimisers/minimisers_frames.csv" iterations | awk '{ n += $1 } END { print n }' >"$folder/sum"
column "$folder/minimisers/minimisers.csv" iterations | awk '{ n += $1 } END { print n }' | cmp -s - "$folder/sum" || fail "iterations of frames"
paste -d, <(column "$folder/minimisers/minimisers.csv" iterations) <(column "$folder/minimisers/minimisers.csv" factorisations) |
  awk -F, 'NR == 2 && !($2 >= $1) || NR != 2 && !($2 < $1) { exit 1 }' || fail "factorisations of minimisers"
expect 0 minimisers --scene "$folder/stages/patch_600.json" --frames 2 --minimisers lbfgs_literal,newton --limit 0 --repeats 2 -o "$folder/limit"
[ "$(column "$folder/limit/minimisers.csv" outcome | grep -c 'stopped after 0 s in frame 1')" = 2 ] || fail "the limit"
expect 0 minimisers --scene "$folder/stages/patch_600.json" --frames 2 --minimisers newton -o "$folder/first"
[ "$(column "$folder/first/minimisers.csv" frames)" = 2 ] || fail "the first frames of a scene"

# Errors against run time: looser is worse, an empty group of parameters has no gradient, what is finished is kept.
cat >"$folder/pareto.json" <<'END'
{"scene": "stages/patch_600.json", "settings": ["/time/frames=3", "/skin/order=1"],
 "measure": {"line": {"from": [-10, 0, 0], "to": [10, 0, 0], "points": 60}},
 "compare": {"window": {"centre": [0, 0, 0], "size": [20, 10], "spacing": "2 mm"},
             "parameters": ["/skin/layers/film/youngs_modulus", "/ligaments/sources/left/strength"],
             "groups": [{"name": "solver", "reference": "tight", "variants": ["loose", "fair", "stopped"]}]},
 "variants": [{"name": "tight", "settings": ["/solver/relative_tolerance=1e-12"]},
              {"name": "loose", "settings": ["/solver/relative_tolerance=0.1"]},
              {"name": "fair", "settings": ["/solver/relative_tolerance=1e-3"]},
              {"name": "stopped", "settings": ["/solver/max_iterations=1", "/time/max_bisections=0"]},
              {"name": "not_compared", "settings": []}]}
END
expect 0 pareto "$folder/pareto.json" -o "$folder/pareto"
for measure in displacement force gradient; do
  awk -F, -v name="${measure}_relative_error" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) c = i; next }
    { e[$2] = $c } END { exit !(e["fair"] > 0 && e["fair"] < 0.1 * e["loose"] && e["loose"] < 1) }' "$folder/pareto/pareto.csv" ||
    fail "errors of $measure"
  grep -q '>fair</text>' "$folder/pareto/solver_$measure.svg" || fail "plot of $measure"
done
grep -q '^solver,stopped,not_converged,' "$folder/pareto/pareto.csv" || fail "a run that fails is a row"
grep -q '^solver,tight,reference,' "$folder/pareto/pareto.csv" || fail "the reference is a row"
[ -e "$folder/pareto/runs/not_compared" ] && fail "what is not compared was run"
cp "$folder/pareto/pareto.csv" "$folder/before.csv"
expect 0 pareto "$folder/pareto.json" -o "$folder/pareto"
cmp -s "$folder/before.csv" "$folder/pareto/pareto.csv" || fail "kept results give another table"
grep -q 'fair: complete before, kept' "$folder/err" || fail "a finished variant ran again"
expect 0 pareto "$folder/pareto.json" --set /time/frames=2 -o "$folder/pareto"
grep -q 'kept' "$folder/err" && fail "a variant with other settings was kept"
sed -i 's/"reference": "tight"/"reference": "best"/' "$folder/pareto.json"
expect 2 pareto "$folder/pareto.json" -o "$folder/x"

# A scene of the user's, and what is refused.
expect 0 gradient --scene "$folder/stages/patch_600.json" --set /time/frames=1 --repeats 1 --parameters 1 -o "$folder/own"
expect 2 gradient --scene "$folder/none.json" -o "$folder/x"
expect 2 stages --nodes 10 -o "$folder/x"
expect 2 tolerance --tolerances 2 -o "$folder/x"
expect 2 minimisers --minimisers simplex -o "$folder/x"
expect 2 nonsense -o "$folder/x"
exit "$failures"
