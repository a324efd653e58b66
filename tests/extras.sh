#!/usr/bin/env bash
# What tests use and no Debian package brings: linters of OpenAPI (npm), numpy, requests and schemathesis
# (PyPI), below build/extras.  tests/extras.sh installs; tests/extras.sh lint runs the linters.
set -u
cd "$(dirname "$0")/.."
export LC_ALL=C
npm=build/extras/npm python=build/extras/python
install() {
    mkdir -p build/extras
    if [ ! -x $npm/node_modules/.bin/spectral ]; then
        if ! command -v npm >/dev/null; then
            echo "extras: no npm, so no linters"
        else
            mkdir -p $npm
            npm install --prefix $npm --no-audit --no-fund --silent @redocly/cli@2 @stoplight/spectral-cli@6 >$npm/log 2>&1 ||
                { tail -n 3 $npm/log; echo "extras: npm install failed"; }
        fi
    fi
    if ! $python/bin/python -c 'import numpy, requests, schemathesis' 2>/dev/null; then
        python3 -m venv $python 2>/dev/null && $python/bin/pip install -q numpy requests schemathesis ||
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
case ${1:-install} in
install) install ;;
lint)
    echo 'extends: ["spectral:oas"]' >build/extras.spectral.yaml
    lint redocly $npm/node_modules/.bin/redocly lint api/openapi.json
    lint spectral $npm/node_modules/.bin/spectral lint --fail-severity warn -r build/extras.spectral.yaml api/openapi.json
    ;;
esac
