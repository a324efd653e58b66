#!/bin/sh
# tests/fuzz/measurements.sh BUILD [RUNS]: the reader of each measurement for RUNS inputs (1e6), from its corpus.
build=$1 runs=${2:-1000000}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
for name in bsdf csv merl utia samples; do
    mkdir -p "$build/corpus/$name"
    if "$build/tests/fuzz/fuzz_$name" -runs="$runs" -max_len=4096 -verbosity=0 -print_final_stats=1 \
        "$build/corpus/$name" "tests/fuzz/corpus/$name" >"$log" 2>&1; then
        echo "ok fuzz/$name $(grep -o 'number_of_executed_units: .*' "$log")"
    else
        sed 's/^/  /' "$log" | tail -n 25
        echo "FAIL fuzz/$name"
    fi
done
