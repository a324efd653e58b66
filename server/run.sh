#!/usr/bin/env bash
# run.sh FACETD PORT - the daemon in the foreground and one real answer (make run).
#
# On a terminal the daemon gets a process group of its own (set -m), so that Ctrl-C reaches it alone:
# it drains and exits 0, and so do this script and make, which would otherwise die of the signal.
# Should this script be killed, setpriv has the kernel tell the daemon.
set -o pipefail
[ -t 0 ] && set -m
setpriv --pdeathsig TERM -- "$1" --port "$2" | {
    trap '' INT
    while IFS= read -r line; do
        printf '%s\n' "$line"
        [[ $line == "listening on "* ]] || continue
        url=${line#listening on }
        body='{"material":{"ndf":"ggx","alpha":0.3},"wi":[[0.6,0,0.8]],"wo":[[-0.6,0,0.8]]}'
        printf "\ncurl -s %s/v1/eval -d '%s'\n" "$url" "$body"
        curl -sS --max-time 10 "$url/v1/eval" -d "$body"
        printf '\nSee it in a browser: %s/\nCtrl-C ends it.\n' "$url"
    done
}
