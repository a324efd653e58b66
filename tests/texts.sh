#!/usr/bin/env bash
# Do the texts say what is so?  README's table of packages against packages.txt, every path and every
# make target a text names, README's requests against a daemon.  `tests/texts.sh packages` prints the table.
set -u
cd "$(dirname "$0")/.."
failed=0
say() { # say ok|FAIL NAME [DETAIL]
    [ -z "${3:-}" ] || printf '%s\n' "$3" | sed 's/^/  /'
    echo "$1 texts/$2"
    [ "$1" = ok ] || failed=1
}

packages() {
    echo '| Debian package | needed | why |'
    echo '|---|---|---|'
    awk -F'|' '!/^#/ && NF == 3 {
        for (i = 1; i <= 3; i++) gsub(/^ +| +$/, "", $i)
        when = $2 == "build" ? "to build" : $2 == "run" ? "to run" : "for `make " $2 "`"
        printf "| `%s` | %s | %s |\n", $1, when, $3 }' packages.txt
}
[ "${1:-}" != packages ] || { packages; exit; }

# lib/accuracy.def as a table: a column a tier.
promises() {
    awk -F'[(,)]' '
        /^ALL_QUANTITIES\([A-Z]/ { for (i = 2; i <= 8; i++) gsub(/ /, "", $i)
            split("fr, fr_cos|pdf, D_vis|D|G, G1_i, G1_o|sigma_o", name, "|")
            for (q = 1; q <= 5; q++) { key = tolower($3) " " name[q]; bound[key, $2] = $(q + 3); if (!(key in seen)) { seen[key]; order[++n] = key } } }
        /^SAMPLER\([A-Z]/ { for (i = 2; i <= 4; i++) gsub(/ /, "", $i)
            if ($3 == "BOUNDED") { key = "bounded, added to ggx pdf"
                bound[key, $2] = $4; if (!(key in seen)) { seen[key]; order[++n] = key } } }
        /^FRESNEL\([A-Z]/ { for (i = 2; i <= 5; i++) gsub(/ /, "", $i)
            if ($3 != "IDEAL") { key = "F " tolower($3) " (and what it adds to fr)"
                bound[key, $2] = $4 == $5 ? $4 : $4 " (" $5 ")"; if (!(key in seen)) { seen[key]; order[++n] = key } } }
        /^TRANSMISSION\([A-Z]/ { for (i = 2; i <= 4; i++) gsub(/ /, "", $i)
            key = tolower($3) " across rough glass, added to D, sigma_o and pdf"
            bound[key, $2] = $4; if (!(key in seen)) { seen[key]; order[++n] = key } }
        END { print "| largest relative error of | draft | fast | exact32 | precise |\n|---|---|---|---|---|"
            for (i = 1; i <= n; i++) { row = "| " order[i]
                split("DRAFT FAST EXACT32 PRECISE", tier, " ")
                for (t = 1; t <= 4; t++) row = row " | " ((order[i], tier[t]) in bound ? bound[order[i], tier[t]] : "-")
                print row " |" } }' lib/accuracy.def
}
[ "${1:-}" != promises ] || { promises; exit; }

# 1. the table of packages
difference=$(diff <(packages) <(grep -E '^\|.*\|$' README.md | awk '/^\| Debian package/ {on = 1} on')) &&
    say ok packages || say FAIL packages "$difference
tests/texts.sh packages prints the table README should have"

# the table of promises
difference=$(diff <(promises) <(grep -E '^\|.*\|$' README.md | awk '/^\| largest relative error/ {on = 1} /^\| Debian/ {on = 0} on')) &&
    say ok promises || say FAIL promises "$difference
tests/texts.sh promises prints the table README should have"

# 2. every path in backticks exists, be it whole, a pattern, or one of its <placeholders>
for text in README.md CONTRIBUTING.md lib/NOTATION.md; do
    missing=
    for path in $(grep -oE '`(api|lib|server|tests|page|\.ci)/[^` ]*`' "$text" | tr -d '`' | sort -u); do
        pattern=$(sed 's/<[^>]*>/*/g' <<<"$path")
        compgen -G "$pattern" >/dev/null || missing+="$text names $path, which is not there"$'\n'
    done
    [ -z "$missing" ] && say ok "paths $text" || say FAIL "paths $text" "${missing%$'\n'}"
done

# 3. every make target exists
missing=
for target in $(grep -ohE '`make [a-z][a-z0-9-]*' README.md CONTRIBUTING.md | cut -d' ' -f2 | sort -u); do
    grep -qE "^([a-z0-9-]+ )*$target( [a-z0-9-]+)*:" Makefile || missing+="no make target $target"$'\n'
done
[ -z "$missing" ] && say ok targets || say FAIL targets "${missing%$'\n'}"

# 4. README's requests and answers
build/release/tests/client/facet_readme --daemon build/release/facetd --cases tests/client/cases \
    --check README.md || failed=1
exit $failed
