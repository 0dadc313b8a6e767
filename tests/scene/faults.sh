#!/bin/sh
# Every command under every fault: full disk, read-only folder, closed pipe, Ctrl-C. The exit code is that of
# scene/README.md, one message says why, and what lies in the folder is whole: tables end with a whole row, every
# other file is whole or not there. SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/faults.sh PROGRAM ROBOT PROBLEM
set -u

program=$1 robot=$2 problem=$3
work=$(mktemp -d)
trap 'umount "$work/small" 2>/dev/null; rm -rf "$work"' EXIT
wrong=0 tried=0
complain() { echo "$*"; [ ! -s "$work/said" ] || sed 's/^/    /' "$work/said"; wrong=1; }

"$program" new pendulum "$work/pendulum.toml" >/dev/null || exit 1
"$program" new bounce "$work/bounce.toml" >/dev/null || exit 1
sed 's/^end = .*/end = 99999/' "$work/pendulum.toml" >"$work/long.toml"
cp "$robot" "$work/robot" && cp "$problem" "$work/problem.dat" || exit 1
chmod 755 "$work"

# arguments NAME FOLDER: the command line, in $line; `long_` ones go on for minutes.
commands="run events cost sweep import new check plan contact"
long_commands="long_run long_last long_cost long_sweep long_plan"
arguments() {
  case $1 in
    run) line="run $work/pendulum.toml --end 0.2 --every 0.02 --quiet --output $2 --csv a.csv --vtk f.pvd
      --svg a.svg --html a.html --state a.state" ;;
    events) line="run $work/bounce.toml --end 0.5 --every 0.001 --quiet --output $2 --csv a.csv" ;;
    cost) line="cost $work/pendulum.toml --tolerances 1e-3,1e-4 --reference 1e-5 --csv $2/a.csv --svg $2/a.svg
      --html $2/a.html" ;;
    sweep) line="sweep $work/pendulum.toml --vary smooth.tolerance=1e-3,1e-4 --quiet --out $2/a.csv" ;;
    import) line="import $work/robot --out $2/a.toml" ;;
    new) line="new pendulum $2/a.toml" ;;
    check) line="check --print $work/pendulum.toml" ;;
    plan) line="plan $work/pendulum.toml --run" ;;
    contact) line="contact $work/problem.dat" ;;
    long_run) line="run $work/pendulum.toml --end 99999 --every 0.5 --quiet --output $2 --csv a.csv --vtk f.pvd
      --html a.html --state a.state" ;;
    long_last) line="run $work/pendulum.toml --end 99999 --every 99999 --quiet --output $2 --state a.state" ;;
    long_cost) line="cost $work/long.toml --tolerances 1e-3:1e-9 --csv $2/a.csv --svg $2/a.svg" ;;
    long_sweep) line="sweep $work/long.toml --vary smooth.tolerance=1e-3,1e-4,1e-5 --jobs 2 --quiet --out $2/a.csv" ;;
    long_plan) line="plan $work/long.toml --run" ;;
  esac
}
writes_files() { case $1 in check | plan | contact | long_plan) false ;; esac; }

# last FILE TEXT: whether it ends so.
last() { [ "$(tail -c 100 "$1" | tail -n 1)" = "$2" ]; }

# whole FOLDER WHAT: no file in it is cut.
whole() {
  for file in $(find "$1" -type f); do
    case $file in
      *.csv)
        [ ! -s "$file" ] || [ "$(tail -c 1 "$file" | od -An -c | tr -d ' ')" = '\n' ] ||
          complain "$2: $file ends within a row"
        awk -F, 'NR == 1 { n = NF } NF != n { exit 1 }' "$file" || complain "$2: a cut row in $file" ;;
      *.svg) tail -c 20 "$file" | grep -q '</svg>' || complain "$2: $file is cut" ;;
      *.html) last "$file" '</html>' || complain "$2: $file is cut" ;;
      *.vtp) last "$file" '</VTKFile>' || complain "$2: $file is cut" ;;
      *.pvd) last "$file" '</VTKFile>' || complain "$2: $file is cut"
        for frame in $(sed -n 's/.* file="\([^"]*\)".*/\1/p' "$file"); do
          [ -f "${file%/*}/$frame" ] || complain "$2: $frame is missing"
        done ;;
      *.state)
        code=0
        timeout --preserve-status -s INT 0.1 "$program" run "$work/pendulum.toml" --quiet --end 99999 --every 9 --force --restart "$file" \
          >"$work/restart_said" 2>&1 || code=$?
        [ $code -eq 130 ] || complain "$2: $file does not go on: $(cat "$work/restart_said")" ;;
      *.toml) "$program" check "$file" >"$work/said" 2>&1 || complain "$2: $file is cut" ;;
      *) complain "$2: left behind: $file" ;;
    esac
  done
}

# try WHAT CODES NAME WRAPPER...: runs a command behind a wrapper; its exit code is one of CODES ("0 2"). What it
# prints goes through a pipe, since a limit of file sizes is one of that of files, too.
try() {
  what="$3, $1" codes=$2
  arguments "$3" "$work/out"
  shift 3
  # shellcheck disable=SC2086
  { "$@" "$program" $line 2>&1 >/dev/null; echo $? >"$work/code"; } | cat >"$work/said"
  code=$(cat "$work/code")
  tried=$((tried + 1))
  case " $codes " in *" $code "*) ;; *) complain "$what: exit code $code, expected $codes" ;; esac
  [ "$code" -ne 2 ] || [ "$(grep -c 'cannot write\|cannot make' "$work/said")" -eq 1 ] ||
    complain "$what: not one message"
  whole "$work/out" "$what"
}
fresh() { rm -rf "$work/out" && mkdir "$work/out"; }
limited() {  # BLOCKS COMMAND...
  (ulimit -f "$1" && shift && exec "$@")
}

# A limit of file sizes is the full disk that everybody can have.
for name in $commands; do
  writes_files $name || continue
  for blocks in 0 5; do
    fresh
    case $blocks in 0) codes=2 ;; *) codes="0 2" ;; esac
    try "$blocks blocks" "$codes" $name limited $blocks
  done
done
# A small file system, where this may be mounted.
mkdir "$work/small"
if mount -t tmpfs -o size=16k tmpfs "$work/small" 2>/dev/null; then
  for name in $commands; do
    writes_files $name || continue
    rm -rf "$work/out" "$work/small/out" && mkdir "$work/small/out" && ln -s "$work/small/out" "$work/out"
    try "16 kB" "0 2" $name env
  done
  rm -rf "$work/out"
  umount "$work/small"
else
  echo "no small file system: needs the right to mount"
fi

# A folder without the right to write, not for root, whom nothing keeps. Nothing is left in it, and the work is
# not begun: a run of minutes fails at once.
as_nobody="env"
[ "$(id -u)" -ne 0 ] || as_nobody="setpriv --reuid=65534 --regid=65534 --clear-groups"
# shellcheck disable=SC2086
if $as_nobody "$program" check "$work/pendulum.toml" >/dev/null 2>&1; then
  for name in $commands $long_commands; do
    writes_files $name || continue
    fresh
    chmod 555 "$work/out"
    # shellcheck disable=SC2086
    try "a read-only folder" 2 $name $as_nobody timeout 60
    [ -z "$(ls -A "$work/out")" ] || complain "$what: something in it"
  done
  for file in csv vtk svg html state; do
    # shellcheck disable=SC2086
    $as_nobody timeout 60 "$program" run "$work/pendulum.toml" --end 99999 --quiet --output "$work/out" --$file a.$file \
      >"$work/said" 2>&1
    code=$?
    [ $code -eq 2 ] || complain "--$file into a read-only folder: exit code $code"
  done
else
  echo "no read-only folders: nobody may run $program"
fi

# A reader that has left before the first word.
for name in $commands; do
  fresh
  arguments $name "$work/out"
  # shellcheck disable=SC2086
  { sleep 0.02; "$program" $line 2>"$work/said"; echo $? >"$work/code"; } | true
  tried=$((tried + 1))
  code=$(cat "$work/code")
  [ "$code" -eq 141 ] || complain "$name, a closed pipe: exit code $code"
  [ ! -s "$work/said" ] || [ $name = import ] || [ $name = cost ] || complain "$name, a closed pipe: not silent"
  whole "$work/out" "$name, a closed pipe"
done

# Ctrl-C, as timeout(1) sends it: to the process and to its group.
for name in $commands $long_commands; do
  for after in 0.003 0.02 0.15; do
    case $name in long_*) codes=130 ;; *) codes="0 130" ;; esac
    fresh
    try "Ctrl-C after $after s" "$codes" $name timeout --preserve-status -s INT $after
  done
done
[ $wrong -eq 0 ] && echo "$tried faults: files are whole"
exit $wrong
