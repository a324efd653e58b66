# leadr_lobes.dat to a picture: gnuplot in the report's folder
set terminal pngcairo size 900,600
set output "leadr_lobes.png"
set title "f_r cos over theta_i, theta_o = 45 degrees, the whole map"
set xlabel "theta_i, degrees"
set key top left
set grid
plot "leadr_lobes.dat" using 1:2 with points pointtype 7 title "brute force", \
     for [w=3:7] "" using 1:w with lines linewidth 2 title word("central forward bilinear CLEAN normal", w-2)
