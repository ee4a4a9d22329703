#!/bin/sh
# What recorded OpenGL programs take here (functional, without pictures) and on Mesa's llvmpipe: seconds on the clock and of user time, whole
# programs, by turns, as a table in Markdown.
#   tests/llvmpipe.sh DIR [REPETITIONS]      DIR/NAME/*.trace; medians of so many, else of one
# Needs Debian's apitrace, mesa, xvfb and time, and a quiet host. FILLRATE=PROGRAM takes that program, else the release build.
set -eu
root=$(cd -P "$(dirname "$0")/.." && pwd -P)
folder=$1 repetitions=${2:-1}
program=${FILLRATE:-$root/target/release/fillrate}
work=$(mktemp -d)
Xvfb -displayfd 3 -screen 0 1920x1200x24 3> "$work/display" > "$work/server" 2>&1 &
server=$!
trap 'kill "$server"; rm -rf "$work"' EXIT
until [ -s "$work/display" ]; do
    kill -0 "$server" 2> /dev/null || { cat "$work/server" >&2; exit 1; }
    sleep 0.1
done
DISPLAY=:$(cat "$work/display")
export DISPLAY LIBGL_ALWAYS_SOFTWARE=1

# timed FILE COMMAND...: adds its seconds and seconds of user time to a file
timed() {
    file=$1
    shift
    /usr/bin/time -a -o "$file" -f '%e %U' "$@" > "$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
}
# median FILE COLUMN
median() { sort -n -k "$2,$2" "$1" | awk -v c="$2" '{ at[NR] = $c } END { print NR % 2 ? at[(NR + 1) / 2] : (at[NR / 2] + at[NR / 2 + 1]) / 2 }'; }

printf '| recording | frames | llvmpipe | user time | here | user time | of llvmpipe'"'"'s clock |\n|---|--:|--:|--:|--:|--:|--:|\n'
for trace in "$folder"/*/*.trace; do
    name=$(basename "$trace" .trace)
    for repetition in $(seq "$repetitions"); do
        timed "$work/$name.here" "$program" replay "$trace" --fidelity functional --images none --out "$work/out"
        timed "$work/$name.there" eglretrace -b "$trace"
        frames=$(sed -n 's/^Rendered \([0-9]*\) frames.*/\1/p' "$work/log")
    done
    echo "$(median "$work/$name.there" 1) $(median "$work/$name.there" 2) $(median "$work/$name.here" 1) $(median "$work/$name.here" 2)" \
        | awk -v name="$name" -v frames="$frames" '{ printf "| %s | %s | %.2f | %.2f | %.2f | %.2f | %.2f |\n", name, frames, $1, $2, $3, $4, $3 / $1 }'
done
