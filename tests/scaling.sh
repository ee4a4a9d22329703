#!/bin/sh
# What sequences take on 1, 2, 4, ... processors, of the time on one: a table in Markdown. The whole command, without pictures. A share of 1.25/n
# on n processors is what is wanted: the column `x n` at most 1.25. Processors that share power, caches or a host are not n times one: so many
# copies at once, each on one processor, show what n of them do. The column `of copies` has the time on n over that of n copies, times n: what the
# command itself loses. Runs take turns, and a ratio has two runs of the same turn, so that a slow minute of the host meets both.
#   tests/scaling.sh [REPETITIONS [FRAMES...]]      medians of so many repetitions, else of one; of short sequences as many as take two minutes
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

# copies PROCESSORS TRACE: seconds of so many replays at once
copies() {
    begun=$(date +%s.%N)
    for cpu in $(echo "$order" | head -n "$1"); do
        taskset -c "$cpu" "$program" replay "$work/$2.zip" --images none --threads 1 --out "$work/out.$cpu" > "$work/log.$cpu" 2>&1 &
    done
    wait
    for cpu in $(echo "$order" | head -n "$1"); do
        [ -s "$work/out.$cpu/stats.json" ] || { cat "$work/log.$cpu" >&2; exit 1; }
        rm -r "$work/out.$cpu"
    done
    echo "$begun $(date +%s.%N)" | awk '{ print $2 - $1 }'
}
# ratio A B: appends the quotient of two times
ratio() { echo "$1 $2" | awk '{ print $1 / $2 }' >> "$3"; }

last=$(echo "$counts" | tail -n 1)
printf '| sequence | turns | on one processor |'
for n in $counts; do [ "$n" = 1 ] || printf ' %s: share | x %s | of copies |' "$n" "$n"; done
printf ' `sampled`, 8 frames: times as fast as `cycle`, on %s |\n|---|--:|--:|' "$last"
for n in $counts; do [ "$n" = 1 ] || printf -- '--:|--:|--:|'; done
printf -- '--:|\n'
for trace in flight interface swarm shadow-once; do
    turn=0 until=$(($(date +%s) + (repetitions > 1 ? 120 : 0)))
    while [ "$turn" -lt "$repetitions" ] || [ "$(date +%s)" -lt "$until" ]; do
        turn=$((turn + 1)) one=$(seconds 1 "$trace")
        echo "$one" >> "$work/$trace.1"
        time=$one
        for n in $counts; do
            [ "$n" != 1 ] || continue
            time=$(seconds "$n" "$trace")
            ratio "$time" "$one" "$work/$trace.$n"
            ratio "$time" "$(copies "$n" "$trace")" "$work/$trace.$n.copies"
        done
        ratio "$time" "$(seconds "$last" "$trace" --fidelity sampled --samples 8)" "$work/$trace.sampled"
    done
    printf '| `%s` | %s | %.2f s |' "$trace" "$turn" "$(median "$work/$trace.1")"
    for n in $counts; do
        [ "$n" = 1 ] || echo "$(median "$work/$trace.$n") $(median "$work/$trace.$n.copies")" \
            | awk -v n="$n" '{ printf " %.3f | %.2f | %.2f |", $1, $1 * n, $2 * n }'
    done
    printf ' %.1f |\n' "$(median "$work/$trace.sampled")"
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
printf '\nMeasured on %s, %s processors of %s cores, medians of at least %s turns, %s\n' \
    "$(lscpu | sed -n 's/^Model name: *//p' | head -n 1)" "$all" "$cores" "$repetitions" "$(date +%F)"
