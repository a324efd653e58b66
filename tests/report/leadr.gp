# leadr_lobes.dat to a picture, and what is what to those of the surfaces: gnuplot in the report's folder
set terminal pngcairo size 900,600
set output "leadr_lobes.png"
set title "f_r cos over theta_i, theta_o = 45 degrees, the whole map (the mean normal rises to 11)"
set xlabel "theta_i, degrees"
set key top left
set grid
set yrange [0:3]
plot "leadr_lobes.dat" using 1:2 with points pointtype 7 title "brute force", \
     for [w=3:7] "" using 1:w with lines linewidth 2 title word("central forward bilinear CLEAN normal", w-2)
set output

reset
set terminal pngcairo size 1540,940
unset tics
unset border
unset key
set lmargin at screen 70.0/1540
set rmargin at screen 1534.0/1540
set bmargin at screen 10.0/940
set tmargin at screen 886.0/940
columns = "'brute force' bilinear CLEAN 'mean normal' '|bilinear - brute force| times 4'"
do for [k=1:5] { set label k word(columns, k) at graph (k-0.5)/5, screen 910.0/940 center }
do for [k=1:3] { set label 5+k sprintf("level %d", 2*k) at screen 35.0/1540, graph 1-(k-0.5)/3 center rotate by 90 }
do for [name in "smooth grooves measured"] {
    file = "leadr_".name.".png"
    if (system("test -f ".file." && echo y") eq "y") {
        set output file.".new"
        plot [0:1464] [0:876] file binary filetype=png with rgbimage
        set output
        system("mv ".file.".new ".file)
    }
}
