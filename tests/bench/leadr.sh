#!/usr/bin/env bash
# tests/bench/leadr.sh FACETD MAKE_MAP: seconds and memory of /v1/leadr through HTTP; `make bench-leadr`.
# Each line is a daemon of its own: the best of three requests (seconds of the clock, and of the
# daemon's processor time, which a busy machine does not stretch), the peak of the first over the
# idle daemon as multiples of the input's pixels in float (wanted: 8), and what came.
# FACETD_WORKERS=1 measures one worker; else there is one per processor.
set -eu
facetd=$1 make_map=$2
folder=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill "$daemon" 2>/dev/null; rm -rf "$folder"' EXIT

cpu() { awk '{print $14 + $15}' "/proc/$daemon/stat"; } # in 1/100 s
peak() { awk '/VmHWM/ {print $2}' "/proc/$daemon/status"; }

measure() { # measure SIDE KIND QUERY
    local side=$1 kind=$2 query=$3 map=$folder/$1-$2.exr best=999 cpu=999999 idle peak line before
    [ -f "$map" ] || "$make_map" "$side" "$side" "$kind" "$map"
    "$facetd" --port 0 --log events >"$folder/out" 2>&1 &
    daemon=$!
    for try in $(seq 100); do
        grep -q listening "$folder/out" && break
        sleep 0.1
    done
    local port=$(grep -o '127.0.0.1:[0-9]*' "$folder/out" | head -n 1 | cut -d: -f2)
    idle=$(peak)
    for try in 1 2 3; do
        before=$(cpu)
        line=$(curl -s -o /dev/null -w '%{http_code} %{time_total} %{size_download}' -H Expect: \
            --data-binary "@$map" "http://127.0.0.1:$port/v1/leadr?$query")
        [ "$try" != 1 ] || peak=$(peak)
        cpu=$(awk -v a="$cpu" -v b="$(($(cpu) - before))" 'BEGIN {print a < b ? a : b}')
        best=$(awk -v a="$best" -v b="$(cut -d' ' -f2 <<<"$line")" 'BEGIN {print a < b ? a : b}')
        [ "$side" -lt 8192 ] || break
    done
    kill "$daemon"
    wait "$daemon" 2>/dev/null || true
    daemon=
    awk -v side="$side" -v kind="$kind" -v query="$query" -v t="$best" -v cpu="$cpu" -v line="$line" \
        -v kib=$((peak - idle)) 'BEGIN {split(line, l, " ");
        printf "%5d^2 %-7s %-32s %s %6.2f s, processor %5.2f s  peak %7.1f MB = %.2f x  answer %7.1f MB\n", side, kind,
            query == "" ? "(default)" : query, l[1], t, cpu / 100, kib * 1.024e-3, kib * 1024 / (side * side * 4),
            l[3] / 1e6}'
}

for kind in noise smooth 8bit; do
    measure 2048 $kind ''
    measure 2048 $kind compression=none
done
measure 2048 noise 'type=half&form=central'
measure 2048 noise 'form=central&stencil=central'
measure 2047 noise ''
measure 4096 noise ''
measure 8192 noise ''
measure 8192 noise compression=none
