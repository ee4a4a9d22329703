#!/bin/sh
# What builds and tests take, in a fresh clone of the commit that is checked out: a table in Markdown.
#   tests/build_times.sh [ci]      ci: of `.ci/run` too
# Needs the packages of Cargo.lock in Cargo's cache, some 10 GB of disk, and ten minutes of two processors; with ci, half an hour.
set -eu
root=$(cd -P "$(dirname "$0")/.." && pwd -P)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
git clone -q "$root" "$work/clone"
# The recordings that `.ci/run` looks for beside the repository.
[ -n "${FILLRATE_PEERS:-}" ] || [ ! -d "$root/../shared/peers" ] || export FILLRATE_PEERS="$root/../shared/peers"
cd "$work/clone"
# Tests in the clone run no blocks of pages that are slow or of the host: this script is one.
unset CARGO_TARGET_DIR FILLRATE_SLOW FILLRATE_HOST FILLRATE_ONLY FILLRATE_BLESS
export CARGO_TERM_COLOR=never

# row NAME AIM COMMAND...
row() {
    name=$1 aim=$2
    shift 2
    /usr/bin/time -f '%e %U %S' -o "$work/time" "$@" > "$work/log" 2>&1 || { tail -n 20 "$work/log" >&2; exit 1; }
    awk -v name="$name" -v aim="$aim" \
        '{ printf "| %s | %s | %d:%02d | %d s |\n", name, aim, $1 / 60, $1 % 60, $2 + $3 }' "$work/time"
}

echo '| what | aim | clock | processors |'
echo '|---|--:|--:|--:|'
row '`cargo build --release`, from nothing' 2:45 cargo build --locked --release
touch crates/unit/src/setup.rs
row '`cargo build --release`, after one file of `unit`' 0:40 cargo build --locked --release
touch src/report/folder.rs
row '`cargo build --release`, after one file of `src`' '' cargo build --locked --release
cargo test --locked -p fillrate-unit --lib > "$work/log" 2>&1
touch crates/unit/src/setup.rs
row '`cargo test -p fillrate-unit --lib`, after one file of `unit`' 0:30 cargo test --locked -p fillrate-unit --lib
[ "${1:-}" = ci ] || exit 0
rm -rf target
row '`.ci/run`, from nothing' 8:00 .ci/run
