#!/bin/sh
# What sequences take on 1, 2, 4, ... processors, of the time on one: a table in Markdown. The whole command, without pictures. A share of 1.25/n
# on n processors is what is wanted: the column `x n` at most 1.25. Kinds of runs take turns, so that a slow minute of the host meets all of them.
#   tests/scaling.sh [REPETITIONS [FRAMES...]]      medians of so many repetitions, else of one
# With FRAMES also the peak memory and the rate of replays of so many frames of `interface`, on all processors: neither should depend on how many.
# Needs util-linux (taskset, lscpu), with FRAMES GNU time, and a quiet host. FILLRATE=PROGRAM takes that program, else the release build.
set -eu
root=$(cd -P "$(dirname "$0")/.." && pwd -P)
repetitions=${1:-1}
[ $# -lt 1 ] || shift
program=${FILLRATE:-$root/target/release/fillrate}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$program" accuracy runs --record "$work" --frames 240 > "$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
cp "$root/traces/flight.zip" "$work/"

# The processors that this script may use, one of each core first: two threads of a core are not two cores.
allowed=$(taskset -cp $$ | sed 's/.*: //')
order=$(lscpu -p=CPU,CORE | awk -F, -v allowed="$allowed" '
    BEGIN { parts = split(allowed, part, ","); for (i = 1; i <= parts; i++) { ends = split(part[i], at, "-"); for (cpu = at[1]; cpu <= at[ends]; cpu++) may[cpu] = 1 } }
    /^[0-9]/ && ($1 in may) { print seen[$2]++, $1 }' | sort -n -k1,1 -k2,2 | awk '{ print $2 }')
cores=$(lscpu -p=CPU,CORE | awk -F, '/^[0-9]/ { core[$2] = 1 } END { print length(core) }')
all=$(echo "$order" | wc -l)
counts=$(n=1; while [ "$n" -le "$all" ]; do echo "$n"; n=$((n * 2)); done)

# seconds PROCESSORS TRACE OPTIONS...: of one replay
seconds() {
    cpus=$(echo "$order" | head -n "$1" | paste -sd,)
    trace=$2 threads=$1
    shift 2
    begun=$(date +%s.%N)
    taskset -c "$cpus" "$program" replay "$work/$trace.zip" --images none --threads "$threads" --out "$work/out" "$@" > "$work/log" 2>&1 \
        || { cat "$work/log" >&2; exit 1; }
    echo "$begun $(date +%s.%N)" | awk '{ print $2 - $1 }'
}
median() { sort -n "$1" | awk '{ at[NR] = $1 } END { print NR % 2 ? at[(NR + 1) / 2] : (at[NR / 2] + at[NR / 2 + 1]) / 2 }'; }

last=$(echo "$counts" | tail -n 1)
printf '| sequence | on one processor |'
for n in $counts; do [ "$n" = 1 ] || printf ' %s: share | x %s |' "$n" "$n"; done
printf ' `sampled`, 8 frames: times as fast as `cycle`, on %s |\n|---|--:|' "$last"
for n in $counts; do [ "$n" = 1 ] || printf -- '--:|--:|'; done
printf -- '--:|\n'
for trace in flight interface swarm shadow-once; do
    for repetition in $(seq "$repetitions"); do
        for n in $counts; do
            seconds "$n" "$trace" >> "$work/$trace.$n"
        done
        seconds "$last" "$trace" --fidelity sampled --samples 8 >> "$work/$trace.sampled"
    done
    one=$(median "$work/$trace.1")
    printf '| `%s` | %.2f s |' "$trace" "$one"
    for n in $counts; do
        [ "$n" = 1 ] || median "$work/$trace.$n" | awk -v one="$one" -v n="$n" '{ printf " %.3f | %.2f |", $1 / one, $1 / one * n }'
    done
    echo "$(median "$work/$trace.$last") $(median "$work/$trace.sampled")" | awk '{ printf " %.1f |\n", $1 / $2 }'
done
if [ $# -gt 0 ]; then
    printf '\n| `interface` |'
    printf ' %s frames: MB | a second |' "$@"
    printf '\n|---|'
    printf -- '--:|--:|%.0s' "$@"
    printf '\n'
    for frames; do
        "$program" accuracy runs --record "$work/$frames" --frames "$frames" > "$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
    done
    for options in functional bound 'bound --samples 32' 'sampled --samples 32' cycle 'cycle --frames-per-run all'; do
        printf '| `%s` |' "$options"
        for frames; do
            # shellcheck disable=SC2086 # words of options
            /usr/bin/time -o "$work/time" -f '%M %e' "$program" replay "$work/$frames/interface.zip" --images none --out "$work/out" --fidelity $options \
                > "$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
            awk -v frames="$frames" '{ printf " %.1f | %.0f |", $1 * 1024 / 1e6, frames / $2 }' "$work/time"
        done
        printf '\n'
    done
fi
printf '\nMeasured on %s, %s processors of %s cores, medians of %s, %s\n' \
    "$(lscpu | sed -n 's/^Model name: *//p' | head -n 1)" "$all" "$cores" "$repetitions" "$(date +%F)"
