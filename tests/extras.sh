#!/usr/bin/env bash
# What tests use and no Debian package brings: linters of OpenAPI, a browser's driver and axe (npm), numpy and requests (PyPI), below
# build/extras.  tests/extras.sh installs, or gives up soon without a network; lint runs the linters, contract FACETD [EXAMPLES] schemathesis.
set -u
cd "$(dirname "$0")/.."
export LC_ALL=C
npm=build/extras/npm python=build/extras/python
install() {
    mkdir -p build/extras
    # Large, and only one step's: without it that step skips.
    command -v chromium >/dev/null || timeout 240 make -s --no-print-directory deps WHEN=test-page || echo "extras: no Chromium"
    if [ ! -x $npm/node_modules/.bin/spectral ]; then
        if ! command -v npm >/dev/null; then
            echo "extras: no npm, so no linters"
        else
            mkdir -p $npm
            timeout 120 npm install --fetch-retries 0 --prefix $npm --no-audit --no-fund --silent @redocly/cli@2 @stoplight/spectral-cli@6 >$npm/log 2>&1 ||
                { tail -n 3 $npm/log; echo "extras: npm install failed"; }
        fi
    fi
    if command -v chromium >/dev/null && command -v npm >/dev/null && [ ! -d $npm/node_modules/axe-core ]; then
        mkdir -p $npm
        timeout 120 npm install --fetch-retries 0 --prefix $npm --no-audit --no-fund --silent playwright-core@1 axe-core@4 >$npm/log 2>&1 ||
            { tail -n 3 $npm/log; echo "extras: npm install of the page's test failed"; }
    fi
    if ! $python/bin/python -c 'import numpy, requests' 2>/dev/null; then
        python3 -m venv $python 2>/dev/null && timeout 120 $python/bin/python -m pip install -q --retries 0 numpy requests ||
            echo "extras: no Python packages"
    fi
    return 0
}
lint() { # lint NAME COMMAND...
    local name=$1 out
    shift
    [ -x "$1" ] || { echo "skip lint/$name: make extras has not installed it"; return 0; }
    out=$("$@" 2>&1) && echo "ok lint/$name" || { printf '%s\n' "$out" | tail -n 30 | sed 's/^/  /'; echo "FAIL lint/$name"; return 1; }
}
# Conditions between members are no part of a schema (exactly one roughness), so that a request which
# fits the schema may be refused: that check is left out.
contract() { # contract FACETD EXAMPLES
    local st=$python/bin/st log=build/extras/schemathesis.log url
    [ -x $st ] || $python/bin/python -m pip install -q schemathesis
    [ -x $st ] || { echo "skip schemathesis: it cannot be installed"; return 0; }
    # On a busy machine both sides wait: how long an answer takes is not what is asked here.
    "$1" --port 0 --deadline 3600 >build/extras/out 2>build/extras/daemon.log &
    daemon=$!
    trap '[ -z "$daemon" ] || kill "$daemon" 2>/dev/null' EXIT
    for _ in $(seq 200); do grep -qs "^listening on" build/extras/out && break; sleep 0.05; done
    url=$(sed -n 's/^listening on //p' build/extras/out)
    # where it leaves its cache
    if (cd build/extras && python/bin/st run "$url/v1/openapi.json" --url "$url" --max-examples "$2" \
        --request-timeout 3600 --suppress-health-check too_slow --no-color --seed 1 --exclude-checks positive_data_acceptance) >$log 2>&1; then
        echo "ok schemathesis $(grep -oE '[0-9,]+ generated.*' $log)"
    else
        cut -c1-300 $log | tail -n 60 | sed 's/^/  /'
        echo "FAIL schemathesis"
    fi
}
daemon=
case ${1:-install} in
contract) contract "$2" "${3:-100}" ;;
install) install ;;
lint)
    echo 'extends: ["spectral:oas"]' >build/extras.spectral.yaml
    lint redocly $npm/node_modules/.bin/redocly lint api/openapi.json
    lint spectral $npm/node_modules/.bin/spectral lint --fail-severity warn -r build/extras.spectral.yaml api/openapi.json
    ;;
esac
