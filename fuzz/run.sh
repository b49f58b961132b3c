#!/usr/bin/env bash
# Fuzzes every target for a time, several side by side, at low priority:
#   fuzz/run.sh [seconds each, 1800] [side by side, 2] [folder for what is found]
# and prints executions, seconds of CPU and the largest memory of each. A crash, a
# unit of more than the timeout or 2 GiB is kept as an artifact, and the target
# starts anew for the rest of its time. Needs nightly and cargo-fuzz.
# Each run adds a line to fuzz/minutes.csv, so that a target's minutes add up over
# runs for as long as its reader is the same:
#   fuzz/run.sh minutes
# prints how long each target ran on the reader as it is in git's index.
# A machine that is busy makes units look slow: run what is kept once by itself.
set -uo pipefail
cd "$(dirname "$0")"
targets=(wif curve_text bcc vol vdb ovox nrrd obj ply gltf ct_png ct_tiff vti
  picture klems far_table pairs scene fabric checkpoint part
  journal slab_journal peer view)

# The files whose change makes the minutes of a target old: its reader, with the entry.
reader() {
  case $1 in
    wif) echo weave/src/wif.rs weave/src/wif ;;
    curve_text | bcc) echo weave/src/curve_file.rs weave/src/curve_file ;;
    vol) echo volume/src/format/{mod,vol,grid_set}.rs ;;
    vdb) echo volume/src/format/{mod,vdb,grid_set}.rs volume/src/format/vdb ;;
    ovox) echo volume/src/format/{mod,ovox}.rs volume/src/format/ovox ;;
    nrrd) echo volume/src/format/{mod,nrrd,grid_set}.rs volume/src/format/nrrd ;;
    obj | ply | gltf) echo mesh/src ;;
    ct_png | ct_tiff) echo scan/src/input/{mod,stack,"${1#ct_}"}.rs ;;
    vti) echo scan/src/input/{mod,vti}.rs scan/src/input/vti ;;
    picture) echo picture/src ;;
    klems) echo measure/src/klems{,_file}.rs ;;
    far_table) echo surface/src/table ;;
    pairs) echo measure/src/pairs.rs ;;
    scene | fabric) echo scene/src weave/src/wif.rs weave/src/wif weave/src/curve_file.rs ;;
    checkpoint) echo cli/src/{checkpoint,identity}.rs film/src ;;
    part) echo cli/src/commands/merge.rs picture/src film/src ;;
    journal | slab_journal) echo "cli/src/$1.rs" ;;
    peer) echo report/src/bench/peer.rs ;;
    view) echo view/src ;;
  esac
}

# A name for the bytes of these files, without their tests.
code() {
  local paths
  paths=$(reader "$1" | tr ' ' '\n' | sed 's|^|../crates/|')
  # shellcheck disable=SC2086 # paths have no spaces
  git ls-files -s -- $paths "fuzz_targets/$1.rs" | grep -vE '[/_]tests?(\.rs|/)' |
    while read -r _ blob _ path; do
      echo "$path"
      git cat-file blob "$blob" | sed '/^mod tests {/,$d'
    done | git hash-object --stdin | cut -c1-12
}

if [[ ${1:-} == minutes ]]; then
  for t in "${targets[@]}"; do
    awk -F, -v t="$t" -v code="$(code "$t")" '
      $1 == t && $2 == code { n += $3; s += $4; kept += $6 }
      END { printf "%-12s %11d executions, %5.1f minutes of CPU, %d kept\n", t, n, s / 60, kept }
    ' minutes.csv
  done
  exit
fi

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
  awk -v t="$t" -v code="$(code "$t")" -v runs="$runs" \
    -v kept="$(ls "$out/$t/artifacts" | wc -l)" '
    /number_of_executed_units/ { n += $2 } /peak_rss_mb/ && $2 > m { m = $2 }
    /^cpu / { c += $2 + $3 }
    END {
      printf "%-12s %9d executions, %8.1f s of CPU, %5d MiB, %d starts, %d kept\n", t, n, c, m, runs, kept
      printf "%s,%s,%d,%.1f,%d,%d\n", t, code, n, c, m, kept >>"minutes.csv"
    }
  ' "$out/$t"/log.*
}
# The EXR reader of a C++ dependency is linked twice, as one definition.
export ASAN_OPTIONS=detect_odr_violation=0
export -f fuzz code reader
export seconds out timeout bin
printf '%s\n' "${targets[@]}" |
  xargs -P "$side_by_side" -I{} bash -c 'SECONDS=0; fuzz {}'
