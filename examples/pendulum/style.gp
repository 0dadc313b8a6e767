# Tether: what both pictures have in common. SPDX-License-Identifier: BSD-3-Clause
set datafile separator comma
set encoding utf8
set border 3 lc rgb '#404040'
set tics nomirror out tc rgb '#202020'
set grid xtics ytics lc rgb '#e4e4e4' lt 1 lw 0.6
set logscale xy
set format xy '10^{%T}'

# Colour-blind safe (Okabe and Ito): grey for plain IDA, a colour for each set of constraints.
plain = '#7f7f7f'; no_energy = '#0072b2'; energy = '#d55e00'
