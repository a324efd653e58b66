#!/usr/bin/env bash
# Do README's client programs work?  Every fenced block between "<!-- clients -->" and its end is run
# against a daemon of its own, in one directory; each must succeed and say 1000000.
# tests/examples.sh FACETD
set -uo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C
root=$PWD
tmp=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill "$daemon" 2>/dev/null; rm -rf "$tmp"' EXIT
trap 'exit 130' INT TERM

"$1" --port 0 >"$tmp/out" 2>"$tmp/log" &
daemon=$!
for _ in $(seq 200); do
    grep -q '^listening on' "$tmp/out" && break
    kill -0 "$daemon" 2>/dev/null || break
    sleep 0.05
done
host=$(sed -n 's|^listening on http://||p' "$tmp/out")
[ -n "$host" ] || { cat "$tmp/log"; echo "FAIL examples: $1 does not listen"; exit 1; }

python=$root/build/extras/python/bin/python
run() { # run LANGUAGE FILE
    case $1 in
    sh) bash -eu "$2" ;;
    js) node "$2" ;;
    python) "$python" "$2" ;;
    *) echo "no way to run $1"; return 1 ;;
    esac
}
why_not() { # what is missing for LANGUAGE
    case $1 in
    js) command -v node >/dev/null || { echo "node is not installed"; return; }
        node -e 'fetch; FormData' 2>/dev/null || echo "node has no fetch" ;;
    python) "$python" -c 'import numpy, requests' 2>/dev/null || echo "make extras has not installed numpy" ;;
    esac
}

awk -v dir="$tmp" '/<!-- clients -->/ {on = 1} /<!-- clients end -->/ {on = 0}
    !on {next}
    /^```/ {if (file) {close(file); file = ""} else {n++; file = dir "/" n "." substr($0, 4)} next}
    file {print > file}' README.md
failed=0 count=0
for file in "$tmp"/[0-9]*.*; do
    [ -e "$file" ] || continue
    language=${file##*.} name=examples/$language why=$(why_not "${file##*.}")
    count=$((count + 1))
    [ -z "$why" ] || { echo "skip $name: $why"; continue; }
    sed "s|localhost:8080|$host|g" "$file" >"$tmp/program.$language"
    [ "$language" != js ] || mv "$tmp/program.js" "$tmp/program.mjs"
    begin=$(date +%s%N)
    said=$(cd "$tmp" && run "$language" "$tmp"/program.* 2>&1 | tr -d '\0') && [[ $said == *1000000* ]] && echo "ok $name in $((($(date +%s%N) - begin) / 1000000)) ms" ||
        { printf '%s\n' "$said" | sed 's/^/  /'; echo "FAIL $name"; failed=1; }
    rm -f "$tmp"/program.*
done
[ $count -ge 3 ] || { echo "FAIL examples: README has $count"; failed=1; }
exit $failed
