#!/bin/sh
# Fits the surface of every fabric to its volume (with eight times SPP, as the noise of
# the volume counts as error of the fit), compares all models of it, and prints the
# tables of docs/trust.md. Reports come to DIR/FABRIC/report.html, fitted fabrics to
# DIR/FABRIC.toml; what is there already is not made again.
#
#   benches/reports.sh DIR [SPP [TEXELS [FABRIC...]]]
set -eu
dir=${1:?expected a folder for the reports}
spp=${2:-1024}
texels=${3:-96}
[ $# -gt 3 ] && shift 3 && fabrics=$* || fabrics="denim cotton_twill wool_gabardine
    polyester_lining charmeuse silk_shantung organza linen jersey wool_tweed"
organza=${ORGANZA:-target/release/organza}
threads=${THREADS:+--threads $THREADS}
mkdir -p "$dir"
for f in $fabrics; do
    # shellcheck disable=SC2086 # threads is two words or none
    [ -e "$dir/$f.toml" ] || "$organza" fit "scenes/fabrics/$f.toml" -o "$dir/$f.toml" \
        --spp $((8 * spp)) --journal "$dir/$f.journal" --quiet $threads
    # shellcheck disable=SC2086
    [ -e "$dir/$f/report.json" ] || "$organza" compare "$dir/$f.toml" -o "$dir/$f" \
        --models volume,surface,fibres,packed,plain --spp "$spp" \
        --texels "$texels" --texel-spp 32 --quiet $threads
done
# shellcheck disable=SC2086
python3 "$(dirname "$0")/report_tables.py" "$dir" $fabrics
