# Tether: drift of length and energy over time. SPDX-License-Identifier: BSD-3-Clause
#
#   gnuplot -c drift.gp pendulum_drift.csv out.svg  pendulum duration tolerance
#
# Columns of panels: the two forms. Rows: length and energy.
load system('dirname '.ARG0).'/style.gp'
set terminal svg size 900,560 font 'Helvetica,13' background rgb 'white'
set output ARG2
csv = ARG1; p = ARG3; d = ARG4; tolerance = ARG5

set style line 1 lc rgb plain     lw 1.8
set style line 2 lc rgb no_energy lw 1.8
set style line 3 lc rgb energy    lw 1.8

sets_1 = 'none length+velocity length+velocity+energy'
sets_0 = 'none length+velocity+tension length+velocity+tension+energy'
legend = "'plain IDA' 'without energy' 'with energy'"

smallest = 1e-17  # stands for zero on a logarithmic axis
of(form, set) = strcol(1) eq p && strcol(4) eq d && strcol(5) eq form && strcol(6) eq set && \
                strcol(7) eq tolerance
at(form, set) = of(form, set) ? column(8) : NaN
drift(c) = column(c) < smallest ? smallest : column(c)

set multiplot
unset key
set xrange [1e-4*d:d]
set yrange [smallest:1e2]
set ytics 1e-15,1e3; unset mytics

set tmargin at screen 0.895
set bmargin at screen 0.545
set format x ''
set lmargin at screen 0.1
set rmargin at screen 0.52
set title 'index 1' offset 0,-0.6
set ylabel '| length - L | / m' offset 0.3
plot for [i=1:3] csv skip 1 using (at('index 1', word(sets_1, i))):(drift(9)) with lines ls i
set lmargin at screen 0.56
set rmargin at screen 0.985
set title 'index 0' offset 0,-0.6
unset ylabel
set format y ''
plot for [i=1:3] csv skip 1 using (at('index 0', word(sets_0, i))):(drift(9)) with lines ls i

set tmargin at screen 0.505
set bmargin at screen 0.155
set format x '10^{%T}'
set xlabel 't / s' offset 0,0.4
unset title
set lmargin at screen 0.1
set rmargin at screen 0.52
set format y '10^{%T}'
set ylabel '| energy - E_0 | / (J/kg)' offset 0.3
plot for [i=1:3] csv skip 1 using (at('index 1', word(sets_1, i))):(drift(10)) with lines ls i
set lmargin at screen 0.56
set rmargin at screen 0.985
unset ylabel
set format y ''
plot for [i=1:3] csv skip 1 using (at('index 0', word(sets_0, i))):(drift(10)) with lines ls i

set lmargin at screen 0.04
set rmargin at screen 0.98
set tmargin at screen 0.055
set bmargin at screen 0.0
unset border; unset tics; unset xlabel; unset grid; unset logscale
set xrange [0:1]; set yrange [0:1]
set key center center horizontal maxrows 1 Left reverse samplen 2.5 width 1
set label 1 sprintf("%s pendulum, %s s, tolerance %s: largest drift in each window of time", \
  p eq 'earth' ? "Earth" : 'Unit', d, tolerance) at screen 0.5,0.972 center
plot for [i=1:3] NaN with lines ls i title word(legend, i)
unset multiplot
