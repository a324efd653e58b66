#!/usr/bin/env bash
# Everything, once: builds each variant, runs each test, ends with "N passed, N failed[, N skipped]".
# Collects the lines "ok|FAIL|skip name ..." of all steps in build/test.log; exit 0 only if nothing
# failed and every step ran.  `make test` calls this; a step by hand: tests/run.sh STEP...
set -u
cd "$(dirname "$0")/.."
export LC_ALL=C
jobs=$(nproc 2>/dev/null || echo 2)
log=build/test.log
mkdir -p build/test
: >"$log"
started=$SECONDS

# Each step is a process group of its own, so that nothing of it outlives this script.
set -m
child=
end_child() { [ -z "$child" ] || kill -TERM -- "-$child" 2>/dev/null; }
trap end_child EXIT
trap 'exit 130' INT TERM

# Shows FAIL lines with the indented details that came before them.
show_failures() {
    awk '/^  / { detail = detail $0 "\n"; next }
         /^FAIL / { printf "%s%s\n", detail, $0; fflush() }
         { detail = "" }'
}

# step NAME COMMAND...: a step that ends badly without saying FAIL, or says nothing at all, failed.
step() {
    local name=$1 out=build/test/$1.log begin=$SECONDS status
    shift
    [ ${#wanted[@]} -eq 0 ] || [[ " ${wanted[*]} " == *" $name "* ]] || return 0
    "$@" >"$out" 2>&1 </dev/null &
    child=$!
    wait "$child"
    status=$?
    child=
    grep -aE '^(ok|FAIL|skip) ' "$out" >"$out.lines"
    if [ $status -ne 0 ] && ! grep -q '^FAIL ' "$out.lines"; then
        tail -n 25 "$out" | sed 's/^/  /'
        echo "FAIL $name: exit $status" | tee -a "$out.lines"
    elif [ ! -s "$out.lines" ]; then
        tail -n 25 "$out" | sed 's/^/  /'
        echo "FAIL $name: ran no test" | tee -a "$out.lines"
    else
        show_failures <"$out"
    fi
    cat "$out.lines" >>"$log"
    printf '== %-14s %5d ok %3d failed %3d skipped %4d s\n' "$name" \
        "$(grep -c '^ok ' "$out.lines")" "$(grep -c '^FAIL ' "$out.lines")" \
        "$(grep -c '^skip ' "$out.lines")" $((SECONDS - begin))
}

# A build is a step too: it says ok, or shows what the compiler said.
build() {
    make -s -j"$jobs" "$@" && echo "ok build $*"
}

check() {
    make -s -j"$jobs" check "$@"
}

cases() {
    FACET_DAEMON_LOG=$PWD/build/test/$1.daemon.log build/release/tests/client/facet_client \
        --daemon "build/$1/facetd" --cases tests/client/cases --jobs 8 \
        --report "build/test/$1.cases.jsonl" | sed "s|^\(ok\|FAIL\|skip\) client/|&$1/|"
    sanitizer "$1"
}

abuse() {
    FACET_DAEMON_LOG=$PWD/build/test/$1.daemon.log build/release/tests/client/facet_abuse \
        --daemon "build/$1/facetd" --cases tests/client/cases --memory "$2" |
        sed "s|^\(ok\|FAIL\|skip\) abuse/|&$1/|"
    sanitizer "$1"
}

expected() {
    local python
    for python in /usr/bin/python3 python3; do
        "$python" -c 'import mpmath' 2>/dev/null || continue
        "$python" tests/client/expected.py --check tests/client/cases/*/*.json
        return
    done
    echo "skip expected: python3-mpmath is not installed"
}

# What the sanitizers wrote to a daemon's stderr fails the step by itself.
sanitizer() {
    local report=build/test/$1.daemon.log
    if grep -qE 'Sanitizer|runtime error' "$report"; then
        grep -m1 -A25 -E 'Sanitizer|runtime error' "$report" | sed 's/^/  /'
        echo "FAIL $1 daemon: see $report"
    fi
}

# Up to date after the checks of their variants; here for who runs single steps.
daemons() {
    build VARIANT=asan && build VARIANT=tsan
}

# Every call that can fail, failed once, for one request of each kind; `make torture` takes all.
torture() {
    build/release/tests/client/facet_torture --daemon build/release/facetd \
        --fault build/release/tests/torture/libfault.so --cases tests/client/cases \
        --jobs 5 --flags --sandbox=off
}

# Many clients at once, each getting its own answer; `make soak-http` takes half an hour.
load() {
    build/release/tests/client/facet_load --daemon build/release/facetd --cases tests/client/cases \
        --seconds 2 --idle 300
}

# What needs packages that `make test` does without.
extras() {
    make -s -j"$jobs" build/release/tests/server/test_{hostile,listeners,packaging} &&
        for t in hostile listeners packaging; do build/release/tests/server/test_$t; done
}

demo() {
    make -s demo && echo "ok demo"
}

rm -f build/test/*.daemon.log
wanted=("$@")
step build        build all clients
step packages     make -s deps-check
step format       make -s check-format
step gcc          check
step clang        check VARIANT=clang CHECK_ISAS=best
step asan         env FACET_TEST_SCALE=0.1 make -s -j"$jobs" check VARIANT=asan CHECK_ISAS=best
step tsan         check VARIANT=tsan
step daemons      daemons
step cases        cases release
step abuse        abuse release yes
step torture      torture
step load         load
step cases-asan   cases asan
step abuse-asan   abuse asan no
step cases-tsan   cases tsan
step demo         demo
step fuzz         make -s -j"$jobs" VARIANT=asan fuzz-short
step examples     tests/examples.sh build/release/facetd
step lint         tests/extras.sh lint
step tools        tests/export_tools.sh build/release/facetd
step page         tests/page.sh build/release/facetd
step expected     expected
step texts        tests/texts.sh

[[ " ${wanted[*]-} " != *" extras "* ]] || step extras extras

passed=$(grep -c '^ok ' "$log") failed=$(grep -c '^FAIL ' "$log") skipped=$(grep -c '^skip ' "$log")
echo "in $((SECONDS - started)) s; every line is in $log"
if [ "$skipped" -gt 0 ]; then
    echo "$passed passed, $failed failed, $skipped skipped"
else
    echo "$passed passed, $failed failed"
fi
[ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
