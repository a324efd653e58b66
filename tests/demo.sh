#!/usr/bin/env bash
# demo.sh FACETD - real requests to every endpoint of a daemon of its own (make demo).
# Prints each request and the beginning of its answer; ends 0 only if every answer is what it should be.
# Measured materials and maps come from ../shared (or $FACET_SHARED) and are left out, saying so, if absent.
set -u
cd "$(dirname "$0")/.."
export LC_ALL=C
shared=${FACET_SHARED:-../shared}
tmp=$(mktemp -d)
daemon=
finish() {
    [ -z "$daemon" ] || kill "$daemon" 2>/dev/null
    rm -rf "$tmp"
}
trap finish EXIT
trap 'exit 130' INT TERM

failed=0
wrong() {
    printf '  WRONG: %s\n' "$*"
    failed=$((failed + 1))
}

"$1" --port 0 >"$tmp/out" 2>"$tmp/log" &
daemon=$!
for _ in $(seq 200); do
    grep -q '^listening on' "$tmp/out" && break
    kill -0 "$daemon" 2>/dev/null || break
    sleep 0.05
done
url=$(sed -n 's/^listening on //p' "$tmp/out")
[ -n "$url" ] || { cat "$tmp/log"; echo "demo: $1 does not listen"; exit 1; }
echo "$1 listens on $url; resident when idle: $(awk '/VmRSS/ {print $2, $3}' "/proc/$daemon/status")"

brief() { # at most 300 characters of text, or what a binary answer is
    if LC_ALL=C grep -qU $'\x01' "$1"; then
        printf '  (%s bytes, starts %s)\n' "$(stat -c %s "$1")" "$(head -c 4 "$1" | od -An -tx1 | tr -d ' ')"
    else
        echo "  $(head -c 300 "$1")$([ "$(stat -c %s "$1")" -le 300 ] || echo " … ($(stat -c %s "$1") bytes)")"
    fi
}

# ask PATTERN PATH [CURL ARGUMENT...]: a 200 whose answer matches (extended regular expression).
ask() {
    local pattern=$1 path=$2 measured
    shift 2
    printf '\ncurl %s' "'localhost:8080$path'"
    for word; do [[ $word == *[^-a-zA-Z0-9@/._]* ]] && word="'${word//$tmp/\/tmp}'"; printf ' %s' "$word"; done
    echo
    measured=$(curl -sS --max-time 60 -o "$tmp/answer" -w '%{http_code} %{time_total}' "$url$path" "$@")
    brief "$tmp/answer"
    echo "  (status and seconds: $measured)"
    [ "${measured% *}" = 200 ] || wrong "the status is ${measured% *}"
    grep -qaE "$pattern" "$tmp/answer" || wrong "the answer does not match $pattern"
}

# value NAME: the first number of a member of the last answer.
value() { grep -oE "\"$1\":\[*[-+0-9.eE]+" "$tmp/answer" | head -1 | sed 's/.*[:[]//'; }

# near NAME EXPECTED BOUND: that number, to a relative error.
near() {
    awk -v a="$(value "$1")" -v e="$2" -v b="$3" 'BEGIN {
        d = a - e; if (d < 0) d = -d; if (e < 0) m = -e; else m = e
        printf "  %s = %s, expected %.15g, relative error %.2g\n", "'"$1"'", a, e, d / m
        exit !(a != "" && d <= b * m) }' || wrong "$1 is not within $3 of $2"
}

# logged ID: what the log says about a request.
logged() {
    sleep 0.05
    grep -a "id=$1 " "$tmp/log" | grep -oE 'us_receive.*' | sed 's/^/  log: /'
}

gold='{"ndf":"ggx","alpha":0.3,"fresnel":{"schlick":{"f0":[0.95,0.64,0.54]}}}'
pair='"wi":[[0.6,0,0.8]],"wo":[[-0.6,0,0.8]]'

echo; echo "== service"
ask '"status"' /healthz
ask '"tiers"' /v1/capabilities
ask '"openapi":"3\.1' /v1/openapi.json

ask '<!doctype html>' /

echo; echo "== evaluate, density, samples"
# D = 1 / (pi alpha^2), G = 1 / sqrt(1 + alpha^2 tan^2), f = D G / (4 cos cos), at the normal: h = n.
exact=$(awk 'BEGIN {a2 = .09; pi = atan2(0, -1); printf "%.17g", 1 / (pi * a2) / sqrt(1 + a2 * .5625) / (4 * .64)}')
ask '"fr"' /v1/eval -d "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},$pair,\"tolerance\":1e-12}"
near fr "$exact" 1e-12
ask '"fr".*"pdf"' /v1/eval -d "{\"material\":$gold,$pair,\"outputs\":[\"fr\",\"pdf\",\"D\",\"G\",\"F\"]}"
ask '"count":200000' /v1/eval -H 'X-Request-Id: demo-grid' \
    -d '{"material":{"ndf":"ggx","alpha":0.3},"wi":{"grid":{"theta":400,"phi":500}},"wo":[[0,0,1]]}'
logged demo-grid
ask '"pdf"' /v1/pdf -d "{\"material\":{\"ndf\":\"beckmann\",\"alpha_x\":0.2,\"alpha_y\":0.5,\"rho\":0.3},$pair}"
ask '"weight"' /v1/sample -d "{\"material\":$gold,\"wo\":[[0,0,1]],\"n\":4,\"seed\":7}"
ask '"average"' /v1/albedo -d "{\"material\":$gold,\"wo\":{\"theta\":[0,0.7,1.4],\"phi\":[0]},\"average\":true}"
ask '"moments"' /v1/material -d '{"material":{"ndf":"beckmann","alpha_1":0.4,"alpha_2":0.1,"phi":0.5}}'

echo; echo "== fit"
ask '"chosen"' /v1/fit -d '{"source":{"ndf":"beckmann","alpha":0.15},"model":"auto","tolerance":0.01}'
fitted=$(cat "$tmp/answer") # its material goes back as it is
fitted=${fitted%%,\"error\":*}
ask '"fr"' /v1/eval -d "$fitted,$pair}"
csv=$shared/data/brdf/nbrdf/merl_nbrdf.csv
if [ -r "$csv" ] && [ -r "$shared/tools/make_merl.c" ] &&
    ${CC:-gcc} -O3 -o "$tmp/make_merl" "$shared/tools/make_merl.c" -lm; then
    for name in gold-metallic-paint pink-felt chrome-steel nickel; do
        "$tmp/make_merl" "$csv" $name "$tmp/$name.binary" || wrong "make_merl $name"
        ask '"chosen"' '/v1/fit?model=auto&tolerance=0.05' -H "X-Request-Id: demo-$name" -H Expect: \
            --data-binary "@$tmp/$name.binary"
        logged "demo-$name"
    done
else
    echo "  no MERL file: $shared has no networks of measured materials"
fi

echo; echo "== maps"
ask '"levels"' /v1/leadr -H 'Accept: application/json' \
    -d '{"heights":[[0,0.1,0,0.1],[0.1,0.2,0.1,0],[0,0.1,0.3,0.1],[0.1,0,0.1,0]],"scale":0.5}'
png=$shared/data/heights/microsurface/afm_matrix3_16.png
exr=$shared/data/exr/openexr-images/TestImages/GrayRampsHorizontal.exr
magic=$'^\x76\x2f\x31\x01'
for map in "$png" "$exr"; do
    if [ -r "$map" ]; then
        ask "$magic" '/v1/leadr?scale=0.1' -H Expect: --data-binary "@$map"
        ask '"levels"' '/v1/leadr?scale=0.1' -H Expect: -H 'Accept: application/json' --data-binary "@$map"
    else
        echo "  no $map"
    fi
done

echo; echo "== refusals, and the end"
code=$(curl -sS -o "$tmp/answer" -w '%{http_code}' "$url/v1/eval" -d "{\"material\":{\"ndf\":\"ggx\",\"alpha\":-1},$pair}")
brief "$tmp/answer"
[ "$code" = 422 ] && grep -q '"/material/alpha"' "$tmp/answer" || wrong "alpha = -1 gives $code"
kill -TERM "$daemon"
wait "$daemon" || wrong "the daemon ended with $?"
daemon=
if [ $failed -gt 0 ]; then echo "demo: $failed wrong"; exit 1; fi
echo "demo: all answers are what they should be"
