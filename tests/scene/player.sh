#!/bin/sh
# Pages of runs in headless Chromium: each is drawn, without an error of its script or of WebGL, with
# the names of its bodies as text. Skipped (77) where there is no Chromium.
# SPDX-License-Identifier: BSD-3-Clause
#
#   sh tests/scene/player.sh PROGRAM SCENE...
set -u

program=$1
shift
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) ||
  { echo "no chromium here: pages are not looked at"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
wrong=0
page() {
  HOME="$work" timeout 120 "$browser" --headless --no-sandbox --disable-dev-shm-usage --use-angle=swiftshader \
    --enable-unsafe-swiftshader --enable-logging=stderr --virtual-time-budget=2000 --dump-dom "file://$1" \
    >"$work/dom" 2>"$work/log"
}
for scene in "$@"; do
  "$program" run "$scene" --end 0.1 --quiet --html "$work/page.html" >"$work/said" 2>&1 ||
    [ $? -eq 1 ] || { echo "$scene: $(cat "$work/said")"; exit 1; }
  page "$work/page.html#through=1"
  if [ ! -s "$work/dom" ]; then echo "chromium does not start here: $(tail -1 "$work/log")"; exit 77; fi
  if ! grep -q 'data-tether="drawn"' "$work/dom"; then echo "$scene: not drawn"; wrong=1; fi
  if grep -iE 'CONSOLE.*(error|warn|uncaught|refused|invalid)' "$work/log"; then echo "$scene: errors"; wrong=1; fi
  if ! grep -q '<figure>' "$work/dom"; then echo "$scene: no curves"; wrong=1; fi
  if ! grep -q 'id="message" hidden' "$work/dom"; then echo "$scene: a message"; wrong=1; fi
  if grep -q '<img' "$work/dom"; then echo "$scene: a name became an element"; wrong=1; fi
done
# The price of accuracy: points, and the command of each.
"$program" cost "$2" --tolerances 1e-3:1e-6 --reference 1e-8 --wanted 1e-2 --html "$work/cost.html" >"$work/said" 2>&1 ||
  [ $? -eq 1 ] || { cat "$work/said"; wrong=1; }
page "$work/cost.html"
if grep -iE 'CONSOLE.*(error|warn|uncaught|refused|invalid)' "$work/log"; then echo "costs: errors"; wrong=1; fi
[ "$(grep -o '<title>tether cost' "$work/dom" | wc -l)" -eq 4 ] || { echo "costs: not four points"; wrong=1; }
grep -q '<code>tether cost [^<]* --tolerances [^<]*e-0*5 ' "$work/dom" || { echo "costs: no command"; wrong=1; }
cp "$2" "$work/scene.toml"
"$program" cost "$work/scene.toml" --tolerances 1e-3 --html "$work/scene.toml" >"$work/said" 2>&1
[ $? -eq 2 ] || { echo "a page over the scene is not refused"; wrong=1; }
[ $wrong -eq 0 ] && echo "every page is drawn"
exit $wrong
