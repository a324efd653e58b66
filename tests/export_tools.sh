#!/bin/sh
# tests/export_tools.sh FACETD: tests/export_tools.py against a daemon of its own.
# TOOLS_PYTHON: a python with the packages mitsuba and materialx, else python3; it skips what is missing.
python=${TOOLS_PYTHON:-python3}
command -v "$python" >/dev/null || { echo "skip export tools: no $python"; exit 0; }
log=$(mktemp)
"$1" --port 0 >"$log" 2>&1 &
daemon=$!
trap 'kill $daemon 2>/dev/null; rm -f "$log"' EXIT
for _ in 1 2 3 4 5 6 7 8 9 10; do
    url=$(sed -n 's/.*listening on \(http[^ ]*\).*/\1/p' "$log" | head -n 1)
    [ -n "$url" ] && break
    sleep 0.2
done
"$python" tests/export_tools.py "$url"
