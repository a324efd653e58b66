#!/usr/bin/env bash
# tests/fuzz/runs.sh SECONDS NAME:RUNS...: libFuzzer on each target for SECONDS; with 0 until it has had RUNS
# inputs in all calls of this script together, whose sums are in build/corpus/NAME.runs.
set -u
seconds=$1 failed=0
shift
for target in "$@"; do
    name=${target%:*} wanted=${target#*:} place=build/corpus/${target%:*} limit=-1 more=0
    mkdir -p "$place"
    had=$(cat "$place.runs" 2>/dev/null || echo 0)
    # A map of a thousand levels takes the sanitizers longer than what others may.
    longest=10
    [ "$name" != map ] || longest=20
    [ "$seconds" != 0 ] || limit=$((wanted > had ? wanted - had : 0))
    if [ "$limit" != 0 ]; then
        build/fuzz/tests/fuzz/fuzz_"$name" -runs="$limit" -max_total_time="$seconds" -timeout="$longest" \
            -rss_limit_mb=4096 -malloc_limit_mb=1500 -print_final_stats=1 -artifact_prefix="$place-" \
            "$place" "tests/fuzz/corpus/$name" >"$place.log" 2>&1
        status=$?
        more=$(sed -n 's/^stat::number_of_executed_units: *//p' "$place.log")
        had=$((had + ${more:-0}))
        echo "$had" >"$place.runs"
        if [ $status -ne 0 ]; then
            tail -n 30 "$place.log" | sed 's/^/  /'
            echo "FAIL fuzz/$name"
            failed=1
            continue
        fi
    fi
    echo "ok fuzz/$name ${more:-0} executions, $had in all of $wanted"
done
exit $failed
