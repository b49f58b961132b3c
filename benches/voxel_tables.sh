#!/bin/sh
# Reflection and transmission of volumes by voxel size against explicit fibres,
# as tables of CSV in DIR: benches/voxel_tables.sh DIR [SPP]
set -eu
dir=${1:?expected a folder for the tables}
spp=${2:-65536}
organza=${ORGANZA:-target/release/organza}
mkdir -p "$dir"
printf 'theta_i,phi_i\n0,0\n60,0\n60,90\n' > "$dir/incident.csv"
run() {
    [ -e "$3" ] || "$organza" measure "scenes/fabrics/$1.toml" --albedo \
        --pairs "$dir/incident.csv" --spp "$spp" --model "$2" --quiet -o "$3" \
        ${4:+--voxel-um "$4"} ${THREADS:+--threads "$THREADS"}
}
while read -r fabric sizes; do
    run "$fabric" fibres "$dir/$fabric.fibres.csv"
    for um in $sizes; do
        for model in packed plain volume; do
            run "$fabric" $model "$dir/$fabric.$model.$um.csv" "$um"
        done
    done
done <<FABRICS
organza 3 6 12 24
linen 10 20 40 80
denim 10 20 40 80
wool_tweed 10 20 40 80
FABRICS
python3 "$(dirname "$0")/voxel_tables.py" "$dir"
