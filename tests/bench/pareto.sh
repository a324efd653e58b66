#!/usr/bin/env bash
# Draws build/bench/pareto.{svg,png} from what summary.py left in build/bench.
set -eu
cd "$1"
draw() {
    gnuplot <<GNUPLOT
set terminal $1
set output "$2"
set logscale xy
set format y "10^{%L}"
set xlabel "ns per f_r (one core)"
set ylabel "largest relative error"
set title "Speed against error: the tiers of facetd and the textbook"
set key below maxcols 2 noenhanced
set grid
set xrange [0.4:200]
set yrange [1e-16:20]
set xtics (0.5, 1, 2, 5, 10, 20, 50, 100, 200)
curve(n) = "pareto_".n.".txt"
book(n) = "textbook_".n.".txt"
plot for [n in "ggx_iso_schlick ggx_full_dielectric beckmann_iso_schlick beckmann_full_dielectric"] \
         curve(n) using 1:2 with linespoints pointtype 7 pointsize 1.2 linewidth 2 title n noenhanced, \
     for [n in "ggx_iso_schlick ggx_full_dielectric beckmann_iso_schlick beckmann_full_dielectric"] \
         book(n) using 1:2 with points pointtype 2 pointsize 1.6 linewidth 2 title n." textbook" noenhanced, \
     "pareto_ggx_iso_schlick.txt" using 1:2:3 with labels offset -1,-0.9 right notitle
GNUPLOT
}
draw 'svg size 900,640 dynamic background "white"' pareto.svg
draw 'pngcairo size 900,640' pareto.png 2>/dev/null || draw 'png size 900,640' pareto.png
