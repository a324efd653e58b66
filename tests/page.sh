#!/usr/bin/env bash
# page.sh FACETD - drives the page in a real browser against a daemon of its own (tests/page/page.mjs);
# screenshots stay in build/page.  Skips, saying why, what is not installed: chromium, node, playwright-core.
set -u
cd "$(dirname "$0")/.."
export LC_ALL=C
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome)
npm=$PWD/build/extras/npm
shared=${FACET_SHARED:-../shared}
if [ -z "$browser" ]; then
    echo "skip page: chromium is not installed; make test-page installs it"
    exit 0
fi
if ! command -v node >/dev/null || [ ! -d "$npm/node_modules/playwright-core" ] || [ ! -d "$npm/node_modules/axe-core" ]; then
    echo "skip page: node, playwright-core or axe-core is not installed; make test-page fetches the last two with npm"
    exit 0
fi
mkdir -p build/page
# A measured material as MERL publishes it, 35 MB, from the network that was fitted to it.
csv=$shared/data/brdf/nbrdf/merl_nbrdf.csv merl=build/page/gold-metallic-paint.binary
if [ ! -s "$merl" ] && [ -r "$csv" ] && [ -r "$shared/tools/make_merl.c" ]; then
    ${CC:-gcc} -O3 -o build/page/make_merl "$shared/tools/make_merl.c" -lm && build/page/make_merl "$csv" gold-metallic-paint "$merl"
fi
# The screenshots' browser draws by software; --no-sandbox, as containers let it make no namespaces.
FACET_BROWSER=$browser FACET_NPM=$npm/ FACET_SHARED=$shared timeout 300 node tests/page/page.mjs "$1"
