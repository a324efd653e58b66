#!/usr/bin/env bash
# Tiny answers, facetd against nginx, in one run (make bench-http): server on one core, wrk on another,
# medians of ROUNDS rounds taken in turns. Prints requests per second, processor time a request, and
# their ratios to nginx's; timings are reported, not judged, but a stall (no answers for a whole round) fails.
#
#   tests/bench_http.sh FACETD [SECONDS [ROUNDS]]
set -euo pipefail
cd "$(dirname "$0")/.."
facetd=$1 seconds=${2:-3} rounds=${3:-3}
command -v wrk >/dev/null && command -v nginx >/dev/null || { echo "skip bench-http: wrk or nginx is not installed"; exit 0; }
place=$(mktemp -d /tmp/facetd-bench-XXXXXX)
pids=()
finish() { kill "${pids[@]}" 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$place"; }
trap finish EXIT
# Runs in a subshell wherever it is used, which exec replaces: so that finish ends the program itself.
pin() { if [ "$(nproc)" -gt 1 ]; then exec taskset -c "$1" "${@:2}"; else exec "${@:2}"; fi; }

# The log of requests as users get it, into a file; and without it, against an nginx without one.
for log in requests none; do
    pin 0 "$facetd" --port 0 --workers 1 --log $log >"$place/$log.out" 2>"$place/$log.err" &
    pids+=($!)
done
for log in requests none; do
    for _ in $(seq 100); do grep -q '^listening' "$place/$log.out" && break; sleep 0.1; done
done
logged=$(sed -n 's/^listening on //p' "$place/requests.out") silent=$(sed -n 's/^listening on //p' "$place/none.out")
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])' 2>/dev/null || echo 18099)
cat >"$place/nginx.conf" <<EOF
daemon off; worker_processes 1; pid $place/pid; error_log $place/nginx.err;
events { worker_connections 2048; }
http {
    client_body_temp_path $place/b; proxy_temp_path $place/p; fastcgi_temp_path $place/f;
    uwsgi_temp_path $place/u; scgi_temp_path $place/s; keepalive_requests 1000000000;
    server {
        listen 127.0.0.1:$port backlog=4096;
        default_type application/json;
        location /logged { access_log $place/access.log combined; return 200 '{"status":"ok"}\n'; }
        location / { access_log off; return 200 '{"status":"ok"}\n'; }
    }
}
EOF
pin 0 /usr/sbin/nginx -p "$place" -c "$place/nginx.conf" -e "$place/nginx.err" &
pids+=($!)
for _ in $(seq 100); do curl -s -o /dev/null "http://127.0.0.1:$port/" && break; sleep 0.1; done

# Of the thread that answers: the main one of facetd, nginx's worker.
cpu_ns() { cut -d ' ' -f 1 "/proc/$1/schedstat"; }
worker=$(tr -d " " <"/proc/${pids[2]}/task/${pids[2]}/children") # the only child
ask() { # ask CONNECTIONS URL PID -> requests per second, the 99th percentile, processor time a request (us)
    local before
    before=$(cpu_ns "$3")
    (pin 1 wrk -t1 -c "$1" -d "${seconds}s" --latency "$2") >"$place/wrk"
    awk -v ns=$(($(cpu_ns "$3") - before)) '/requests in/ {n = $1} /Requests\/sec/ {r = $2} /99%/ {p = $2}
        END {print int(r), p, n ? ns / n / 1e3 : 0}' "$place/wrk"
}
median() { sort -n | awk '{v[NR] = $1} END {print v[int((NR + 1) / 2)]}'; }

# Processor time tells what a server costs, whatever else runs here.
bad=0
printf '%6s %8s %8s %6s  %7s %7s %6s  %9s %8s %6s   %s\n' conns facetd nginx ratio 'us each' nginx ratio 'with log' nginx ratio 'p99 facetd / nginx'
for c in 16 64 128 256 512; do
    f=() n=() fl=() nl=() fu=() nu=()
    for _ in $(seq "$rounds"); do
        read -r r pf u < <(ask "$c" "$silent/healthz" "${pids[1]}"); f+=("$r") fu+=("$u")
        read -r r pn u < <(ask "$c" "http://127.0.0.1:$port/" "$worker"); n+=("$r") nu+=("$u")
        read -r r _ < <(ask "$c" "$logged/healthz" "${pids[0]}"); fl+=("$r")
        read -r r _ < <(ask "$c" "http://127.0.0.1:$port/logged" "$worker"); nl+=("$r")
    done
    mf=$(printf '%s\n' "${f[@]}" | median) mn=$(printf '%s\n' "${n[@]}" | median)
    uf=$(printf '%s\n' "${fu[@]}" | median) un=$(printf '%s\n' "${nu[@]}" | median)
    ml=$(printf '%s\n' "${fl[@]}" | median) ol=$(printf '%s\n' "${nl[@]}" | median)
    awk -v c="$c" -v f="$mf" -v n="$mn" -v uf="$uf" -v un="$un" -v l="$ml" -v o="$ol" -v pf="$pf" -v pn="$pn" 'BEGIN {
        printf "%6d %8d %8d %6.2f  %7.2f %7.2f %6.2f  %9d %8d %6.2f   %s / %s\n", c, f, n, f / n, uf, un, un / uf, l, o, l / o, pf, pn }'
    [ "$mf" -gt 1000 ] || bad=1
done
[ $bad = 0 ] && echo "ok bench-http" || { echo "FAIL bench-http: a stall"; exit 1; }
