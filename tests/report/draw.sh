#!/usr/bin/env bash
# draw.sh DIRECTORY - the pictures of `make report` from the tables in DIRECTORY, PNG and SVG.
set -eu
cd "$1"
common='set datafile separator ","
set grid lc rgb "#dddddd"
set border lc rgb "#555555"
set key below horizontal'
OLD='#d95f02' NEW='#1b6ca8'

# both NAME WIDTH HEIGHT: standard input is the script that plots.
both() {
    local script
    script=$(cat)
    printf 'set terminal pngcairo size %s,%s font "Sans,11"\nset output "%s.png"\n%s\n%s\nunset multiplot\n' "$2" "$3" "$1" "$common" "$script" | gnuplot
    printf 'set terminal svg size %s,%s font "Sans,11" background "white"\nset output "%s.svg"\n%s\n%s\nunset multiplot\n' "$2" "$3" "$1" "$common" "$script" | gnuplot
}

alphas=(0.1 0.4 1) thetas=(0 1.0 1.5)
names=("Smith, Beckmann" "Smith, GGX" "V-cavity, Beckmann" "V-cavity, GGX")
files=(smith-beckmann smith-ggx vcavity-beckmann vcavity-ggx)
for k in 0 1 2 3; do
    {
        echo "set multiplot layout 3,3 title \"White furnace, ${names[k]}: eight instances each (ndf orange, visible normals blue, exact dashed)\""
        echo 'set logscale x; set xrange [8:4096]; set format x "%g"; set xtics 8,8; unset key'
        for a in 0 1 2; do
            for t in 0 1 2; do
                exact=$(awk -v k=$k -v a=$a -v t=$t '$1 == k && $2 == a && $3 == t {print $4}' furnace-exact.csv)
                echo "set title \"alpha ${alphas[a]}, theta ${thetas[t]} rad: albedo $(printf %.4f "$exact")\""
                echo "set yrange [$exact*0.8:$exact*1.2]"
                [ "$a" = 2 ] && echo 'set xlabel "samples"' || echo 'unset xlabel'
                [ "$t" = 0 ] && echo 'set ylabel "mean so far"' || echo 'unset ylabel'
                echo "plot 'furnace-$k-$a-$t-ndf.csv' skip 1 using 2:3 with lines lw 1 lc rgb '$OLD', \
                    'furnace-$k-$a-$t-visible.csv' skip 1 using 2:3 with lines lw 1 lc rgb '$NEW', \
                    $exact with lines dt 2 lw 1.5 lc rgb 'black'"
            done
        done
    } | both "furnace-${files[k]}" 1200 1000
done

# curves NAME COLUMN YLABEL SETTINGS TITLE: over theta, one panel per distribution and alpha.
methods=(ndf caps bounded slope "slope" vcavity)
colours=("$OLD" "$NEW" "#1b9e77" "#7570b3" "#7570b3" black)
curves() {
    {
        echo "set multiplot layout 2,3 title \"$5\""
        echo "set xrange [0:90]; set xtics 15; set xlabel 'theta_o (degrees)'; set ylabel '$3'; $4"
        for ndf in 0 1; do
            for a in 0 1 2; do
                echo "set title \"$([ $ndf = 0 ] && echo GGX || echo Beckmann), alpha ${alphas[a]}\""
                plots=
                for k in 0 1 2 3 4; do
                    [ -e "curve-$ndf-$a-$k.csv" ] || continue
                    plots+="${plots:+, }'curve-$ndf-$a-$k.csv' skip 1 using 4:$2 with linespoints pt 7 ps 0.4 lw 1.5 lc rgb '${colours[k]}' title '${methods[k]}'"
                done
                echo "plot $plots"
            done
        done
    } | both "$1" 1300 800
}
curves waste '($5*100)' 'wasted samples, %' 'set yrange [0:55]' 'Samples below the horizon, by method'
curves variance 7 'relative variance of one sample' 'set logscale y; set format y "%g"; set yrange [1e-4:20]' 'White furnace, Smith: relative variance (lower is better)'
curves efficiency 9 'efficiency' 'set logscale y; set format y "10^{%T}"; set yrange [1e-1:1e5]' 'Efficiency: 1 / (variance x microseconds), scalar double code of this run (higher is better)'
