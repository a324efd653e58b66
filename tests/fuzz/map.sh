#!/usr/bin/env bash
# tests/fuzz/map.sh FUZZER RUNS [FOLDER...]: run a libFuzzer program over seeds made of the files of
# the folders (each behind eight first bytes), in build/fuzz/corpus; what it finds stays beside it.
set -eu
fuzzer=$1 runs=$2
shift 2
name=$(basename "$fuzzer")
corpus=build/fuzz/corpus/$name
mkdir -p "$corpus" "build/fuzz/found"
for folder in "$@"; do
    [ -d "$folder" ] || continue
    find "$folder" -type f -size -5k | sort | while read -r file; do
        for first in 0 1 2 3 4 5 6 7; do
            { printf "\\x0$first"; cat "$file"; } >"$corpus/seed-$(md5sum <<<"$file" | cut -c1-12)-$first"
        done
    done
done
exec "$fuzzer" -runs="$runs" -max_len=4096 -timeout=20 -rss_limit_mb=3000 -malloc_limit_mb=1500 \
    -artifact_prefix=build/fuzz/found/ -print_final_stats=1 "$corpus"
