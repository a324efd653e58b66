#!/bin/sh
# embed.sh DIRECTORY FILE... - prints the C source that embeds the page's files, each as it is and
# gzipped (into DIRECTORY, without name and time, so that equal files give equal bytes).
set -eu
directory=$1
shift
echo '/* Written by page/embed.sh. */'
echo '#include "page.h"'
n=0
for file; do
    packed=$directory/${file##*/}.gz
    gzip -9nc "$file" >"$packed"
    for form in plain gzip; do
        [ $form = plain ] && bytes=$file || bytes=$packed
        printf '__asm__(".section .rodata\\n%s_%d: .incbin \\"%s\\"\\n%s_%d_end:\\n.previous\\n");\n' $form $n "$bytes" $form $n
        echo "extern const char ${form}_$n[], ${form}_${n}_end[];"
    done
    n=$((n + 1))
done
echo 'const struct page_file page_files[] = {'
n=0
for file; do
    case $file in
    *.html) path=/ type='text/html; charset=utf-8' ;;
    *.css) path=/$file type='text/css; charset=utf-8' ;;
    *.js) path=/$file type='text/javascript; charset=utf-8' ;;
    *.svg) path=/$file type=image/svg+xml ;;
    *) echo "embed.sh: no media type for $file" >&2; exit 1 ;;
    esac
    echo "    {\"$path\", \"$type\", {plain_$n, plain_${n}_end}, {gzip_$n, gzip_${n}_end}},"
    n=$((n + 1))
done
echo '    {0},'
echo '};'
