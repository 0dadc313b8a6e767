# Tether: end error against CPU time. SPDX-License-Identifier: BSD-3-Clause
#
#   gnuplot -c error.gp pendulum.csv out.svg  pendulum duration  pendulum duration
#
# Two panels, each for one pendulum ("earth" or "unit") and one duration in seconds of the CSV file.
# One line for each form and set of constraints, one point for each tolerance; a run that failed
# interrupts its line.
load system('dirname '.ARG0).'/style.gp'
set terminal svg size 900,470 font 'Helvetica,13' background rgb 'white'
set output ARG2
csv = ARG1

# Index 1: solid, filled squares; index 0: dashed, open circles.
set style line 1 lc rgb plain     lw 1.6 dt 1 pt 5 ps 0.5
set style line 2 lc rgb no_energy lw 1.6 dt 1 pt 5 ps 0.5
set style line 3 lc rgb energy    lw 2.2 dt 1 pt 5 ps 0.5
set style line 4 lc rgb plain     lw 1.6 dt 2 pt 6 ps 0.55
set style line 5 lc rgb no_energy lw 1.6 dt 2 pt 6 ps 0.55
set style line 6 lc rgb energy    lw 2.2 dt 2 pt 6 ps 0.55

forms = "'index 1' 'index 1' 'index 1' 'index 0' 'index 0' 'index 0'"
sets = 'none length+velocity length+velocity+energy none length+velocity+tension length+velocity+tension+energy'
legend = "'index 1, plain IDA' 'index 1, length, velocity' 'index 1, length, velocity, energy' 'index 0, plain IDA' 'index 0, length, velocity, tension' 'index 0, length, velocity, tension, energy'"

of(p, d, i) = strcol(1) eq p && strcol(4) eq d && strcol(5) eq word(forms, i) && \
              strcol(6) eq word(sets, i)
cpu(p, d, i) = of(p, d, i) && strcol(8) eq 'ok' ? column(15) : NaN

set multiplot
set tmargin at screen 0.92
set bmargin at screen 0.335
set yrange [1e-11:10]
set ytics 100; unset mytics
set xlabel 'CPU time / ms' offset 0,0.3
unset key

set lmargin at screen 0.1
set rmargin at screen 0.52
set ylabel 'end error' offset 0.3
p = ARG3; d = ARG4
set title sprintf('%s pendulum, %s s', p eq 'earth' ? "Earth" : 'Unit', d) offset 0,-0.6
plot for [i=1:6] csv skip 1 using (cpu(p, d, i)):10 with linespoints ls i

set lmargin at screen 0.56
set rmargin at screen 0.985
unset ylabel
set format y ''
p = ARG5; d = ARG6
set title sprintf('%s pendulum, %s s', p eq 'earth' ? "Earth" : 'Unit', d) offset 0,-0.6
plot for [i=1:6] csv skip 1 using (cpu(p, d, i)):10 with linespoints ls i

# The legend, below both.
set lmargin at screen 0.04
set rmargin at screen 0.98
set tmargin at screen 0.2
set bmargin at screen 0.0
unset border; unset tics; unset xlabel; unset title; unset grid; unset logscale
set xrange [0:1]; set yrange [0:1]
set key center center vertical maxrows 3 Left reverse samplen 3 width 2 spacing 1.25
plot for [i=1:6] NaN with linespoints ls i title word(legend, i)
unset multiplot
