#!/usr/bin/env bash
# Fuzzes every target for a time, several side by side, at low priority:
#   fuzz/run.sh [seconds each, 1800] [side by side, 2] [folder for what is found]
# and prints executions, seconds of CPU and the largest memory of each. A crash, a
# unit of more than the timeout or 2 GiB is kept as an artifact, and the target
# starts anew for the rest of its time. Needs nightly and cargo-fuzz.
# A machine that is busy makes units look slow: run what is kept once by itself.
set -uo pipefail
cd "$(dirname "$0")"
targets=(wif curve_text bcc vol vdb ovox nrrd obj ply gltf ct_png ct_tiff vti
  picture klems far_table pairs scene fabric checkpoint part
  journal peer view)

seconds=${1:-1800} side_by_side=${2:-2} out=${3:-target/found} timeout=${TIMEOUT:-20}
cargo +nightly fuzz build --fuzz-dir . || exit 1
bin=$PWD/target/$(rustc +nightly -vV | sed -n 's/^host: //p')/release
mkdir -p "$out" && out=$(cd "$out" && pwd)
renice -n "${NICE:-19}" $$ >/dev/null # idle priority would get nothing beside other work

fuzz() {
  local t=$1 end=$((SECONDS + seconds)) runs=0
  mkdir -p "$out/$t"/{corpus,artifacts,tmp}
  rm -f "$out/$t"/log.*
  while ((SECONDS < end - 1)); do
    runs=$((runs + 1))
    TMPDIR=$out/$t/tmp bash -c 'TIMEFORMAT="cpu %U %S"; time "$@"' - "$bin/$t" \
      "$out/$t/corpus" "corpus/$t" -max_total_time=$((end - SECONDS)) -rss_limit_mb=2048 \
      -timeout="$timeout" -print_final_stats=1 -artifact_prefix="$out/$t/artifacts/" \
      >"$out/$t/log.$runs" 2>&1
    rm -rf "$out/$t/tmp"/*
  done
  awk -v t="$t" -v runs="$runs" -v kept="$(ls "$out/$t/artifacts" | wc -l)" '
    /number_of_executed_units/ { n += $2 } /peak_rss_mb/ && $2 > m { m = $2 }
    /^cpu / { c += $2 + $3 }
    END {
      printf "%-12s %9d executions, %8.1f s of CPU, %5d MiB, %d starts, %d kept\n", t, n, c, m, runs, kept
    }
  ' "$out/$t"/log.*
}
# The EXR reader of a C++ dependency is linked twice, as one definition.
export ASAN_OPTIONS=detect_odr_violation=0
export -f fuzz
export seconds out timeout bin
printf '%s\n' "${targets[@]}" |
  xargs -P "$side_by_side" -I{} bash -c 'SECONDS=0; fuzz {}'
