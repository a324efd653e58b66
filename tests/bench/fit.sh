#!/usr/bin/env bash
# tests/bench/fit.sh FACETD BENCH FOLDER DATA: milliseconds of fits, in process and of a MERL file
# through HTTP (the best of five: by the clock, and of the daemon's processor time, which a busy
# machine does not stretch; its peak); `make bench-fit`.
set -eu
facetd=$1 bench=$2 folder=$3 data=$4
"$bench"
tool=$data/../tools/make_merl.c table=$data/brdf/nbrdf/merl_nbrdf.csv
if [ ! -r "$tool" ] || [ ! -r "$table" ]; then
    echo "MERL through HTTP: skipped, no $tool and $table"
    exit 0
fi
mkdir -p "$folder"
daemon=
trap '[ -z "$daemon" ] || kill "$daemon" 2>/dev/null' EXIT
[ -x "$folder/make_merl" ] || cc -O3 -o "$folder/make_merl" "$tool" -lm
for material in gold-metallic-paint chrome pink-fabric; do
    map=$folder/$material.binary best=999 cpu=999
    [ -s "$map" ] || "$folder/make_merl" "$table" "$material" "$map"
    : >"$folder/out" # the last daemon listened elsewhere
    "$facetd" --port 0 --log events >"$folder/out" 2>&1 &
    daemon=$!
    until grep -q listening "$folder/out"; do sleep 0.1; done
    url=$(grep -o 'http://[0-9.:]*' "$folder/out" | head -n 1)
    for try in 1 2 3 4 5; do
        before=$(awk '{print $14 + $15}' "/proc/$daemon/stat")
        took=$(curl -s -o /dev/null -w '%{time_total}' -H Expect: --data-binary "@$map" "$url/v1/fit?model=auto")
        after=$(awk '{print $14 + $15}' "/proc/$daemon/stat")
        best=$(awk -v a="$best" -v b="$took" 'BEGIN {print a < b ? a : b}')
        cpu=$(awk -v a="$cpu" -v b="$(((after - before)))" 'BEGIN {print a < b / 100 ? a : b / 100}')
    done
    awk -v m="$material" -v t="$best" -v c="$cpu" -v k="$(awk '/VmHWM/ {print $2}' "/proc/$daemon/status")" 'BEGIN {
        printf "MERL through HTTP, auto: %-27s %8.0f ms (processor %.0f), asked 300; peak %.0f MB, asked 150\n", m, t * 1e3, c * 1e3, k * 1.024e-3}'
    kill "$daemon"
    wait "$daemon" 2>/dev/null || true
    daemon=
done
