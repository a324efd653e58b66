#!/usr/bin/env bash
# tests/check.sh JOBS ISAS PROGRAM... [-- PROGRAM...]: runs the programs, those after -- once per
# instruction set, JOBS at a time; prints what each says in one piece.  A bad end is a FAIL line.
set -u
jobs=$1 isas=$2 each=
shift 2
run_one() {
    local out status
    out=$(env ${2:+FACET_ISA=$2} "$1" 2>&1 </dev/null)
    status=$?
    [ -z "$out" ] || printf '%s\n' "$out"
    [ $status -eq 0 ] || echo "FAIL $1 ${2-} (exit $status)"
}
export -f run_one
for program; do
    if [ "$program" = -- ]; then
        each=yes
    elif [ -z "$each" ]; then
        echo "$program"
    else
        for isa in $isas; do echo "$program $isa"; done
    fi
done | xargs -P "$jobs" -I{} bash -c 'out=$(run_one $1); flock "$0" cat <<<"$out"' "$0" {}
