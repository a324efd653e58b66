#!/usr/bin/env bash
# Builds the Dockerfile and runs the image with buildah: no Docker engine, no registry (make container).
#
# The base image is made from Debian's archive by mmdebstrap, under the name the Dockerfile asks for.
# Everything lives in build/container; needs root. Prints "ok|FAIL container/NAME" and ends 0 only if
# the image answers /healthz and /v1/eval and its HEALTHCHECK command tells well from ill.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(id -u)" = 0 ] || { echo "FAIL container: needs root (overlay mounts, chroot)"; exit 1; }

place=$PWD/build/container
base=docker.io/library/debian:bookworm-slim
mkdir -p "$place"
export CONTAINERS_STORAGE_CONF=$place/storage.conf
printf '[storage]\ndriver = "overlay"\ngraphroot = "%s/graph"\nrunroot = "%s/run"\n' "$place" "$place" \
    >"$CONTAINERS_STORAGE_CONF"

if ! buildah inspect --type image "$base" >/dev/null 2>&1; then
    tar=$place/base.tar
    [ -s "$tar" ] || { mmdebstrap --quiet --variant=minbase --include=ca-certificates bookworm "$tar.new" --format=tar && mv "$tar.new" "$tar"; }
    c=$(buildah from scratch)
    buildah add --quiet "$c" "$tar" /
    buildah commit --quiet --rm "$c" "$base"
    rm -f "$tar"
fi
buildah bud --quiet --format docker --layers --isolation chroot --network host --pull-never -t facetd:test .
echo "image: $(buildah images --format '{{.Size}}' facetd:test)"

c=$(buildah from --pull-never facetd:test)
daemon=
finish() {
    [ -z "$daemon" ] || kill "$daemon" 2>/dev/null || true
    buildah rm "$c" >/dev/null
}
trap finish EXIT
inside() { buildah run --isolation chroot --network host "$c" -- "$@"; }

failed=0
# say NAME COMMAND...: ok if the command succeeds.
say() {
    local name=$1
    shift
    if "$@"; then echo "ok container/$name"; else echo "FAIL container/$name"; failed=1; fi
}

# The network is the host's, so the port is a free one here; in a real container it stays 8080.
# buildah run takes neither entry point nor HEALTHCHECK from the image: read them from there.
out=$place/daemon.out
inspect() { buildah inspect --type image --format "$1" facetd:test; }
entry=$(inspect '{{index .Docker.Config.Entrypoint 0}}')
read -ra check <<<"$(inspect '{{range .Docker.Config.Healthcheck.Test}}{{.}} {{end}}')"
inside "$entry" --port 0 >"$out" 2>"$place/daemon.err" &
daemon=$!
for _ in $(seq 100); do grep -q '^listening on' "$out" && break; sleep 0.1; done
port=$(sed -n 's/^listening on .*:\([0-9]*\)$/\1/p' "$out")
url=http://127.0.0.1:$port

on_all_addresses() { grep -q "^listening on http://0.0.0.0:$port" "$out"; }
not_root() { [ "$(inside id -u)" = 10001 ]; }
healthy() { curl -fsS --max-time 5 "$url/healthz" >/dev/null; }
evaluates() {
    curl -fsS --max-time 5 "$url/v1/eval" -d '{"material":{"ndf":"ggx","alpha":0.3},
        "wi":[[0.6,0,0.8]],"wo":[[-0.6,0,0.8]],"tolerance":1e-12}' | grep -q '1\.34785690'
}
check_well() { [ "${check[0]}" = CMD ] && inside "${check[@]:1}" --port "$port"; }
check_ill() { ! inside "${check[@]:1}" --port 1 2>/dev/null; }
# The daemon is what buildah's process, which we started, ends in: its last only child.
daemon_pid() {
    local pid=$daemon children
    while children=$(cat /proc/"$pid"/task/*/children 2>/dev/null) && [ -n "$children" ]; do
        read -r pid _ <<<"$children"
    done
    [ "$(cat /proc/"$pid"/comm)" = "${entry##*/}" ] && echo "$pid"
}
drains() {
    local pid
    pid=$(daemon_pid) && kill -TERM "$pid" && wait "$daemon"
}
say listens_on_all_addresses on_all_addresses
say is_not_root not_root
say healthz healthy
say eval evaluates
say healthcheck_well check_well
say healthcheck_ill check_ill
say sigterm_ends_0 drains
daemon=
exit $failed
