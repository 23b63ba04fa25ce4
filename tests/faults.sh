#!/usr/bin/env bash
# Lets one call to the file system after the other fail in runs of a small pipeline, and holds what comes of it against the
# promises.
#
#   tests/faults.sh target/release/trodden "$(mktemp -d)" 1
#
# Arguments: the program, an empty folder to work in, and which calls: 1 is all of them, 40 every fortieth; then, if wanted,
# `cold` (an empty store) or `warm` (another setting on a finished one), and the number of an error (28 is a full disk, 5 a
# broken one, 0 kills the process instead). Each run with a fault ends in time, without a panic, with exit code 1, a message
# that names the store (or with 0 and the right digests, where the fault could be borne), and the next run without one ends
# with the right digests on a store that `verify` finds clean. Exits with 1 after the last if any run broke a promise, with
# 77 if there is no C compiler.
set -euo pipefail

if [ $# -lt 3 ]; then
    sed -n '2,15s/^# \{0,1\}//p' "$0" >&2
    exit 2
fi
trodden=$(realpath "$1")
source=$(realpath "$(dirname "$0")")/faults/fault.c
mkdir -p "$2"
cd "$2"
work=$(pwd -P)
every=$3
phases=${4:-cold warm}
errors=${5:-28 5}
command -v cc >/dev/null || { echo "skipped: there is no C compiler" && exit 77; }
cc -shared -fPIC -O1 -o fault.so "$source" -ldl

cat >small.yaml <<'YAML'
seed: 7
maps: { all: { homes: { count: 1, area: [50, 60] } } }
stages:
  walks: { use: simulate, map: $maps, episodes: 2, agents: [2, 3], duration: 5 }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize, map: $maps, visits: visits, classes: 3 }
  tiles: { use: tile, map: $maps.all, labels: labels.all, size: 16, stride: 16, min_labeled: 1 }
  model: { use: train, tiles: tiles, epochs: 1 }
YAML

broken=0
broke() {
    broken=$((broken + 1))
    echo "BROKEN: $*"
    tail -n 5 stderr.txt | sed 's/^/    /'
}

# run [SETTINGS…]: runs the pipeline on the store; its exit code is in `code`.
run() {
    code=0
    # bash has a word of its own for each that is killed.
    { timeout 120 "$@" "$trodden" --store store --json run small.yaml --jobs 1 "${settings[@]}" >stdout.txt 2>stderr.txt; } \
        2>shell.txt || code=$?
}

# digests: the nodes that the last run made or found, with their digests.
digests() {
    sed -n 's/^{"event":"node","node":"\([^"]*\)",.*"outcome":"\(ran\|hit\)","digest":"\([0-9a-f]\{64\}\)".*/\1 \3/p' stdout.txt | sort
}

# judge WHAT: holds a run with a fault, the next one without, and the store against the promises.
judge() {
    case $code in
    0) digests | cmp -s - expected || broke "$1: exit code 0 with other digests" ;;
    1) grep -q 'store' stderr.txt || broke "$1: the message does not name the store" ;;
    137) [ "$error" = 0 ] || broke "$1: it was killed" ;;
    124) broke "$1: it hung" ;;
    *) broke "$1: exit code $code" ;;
    esac
    ! grep -q 'panicked' stderr.txt || broke "$1: it panicked"
    run env
    [ "$code" = 0 ] || broke "$1: the next run ended with $code"
    digests | cmp -s - expected || broke "$1: the next run ended with other digests"
    "$trodden" --store store verify >stderr.txt 2>&1 || broke "$1: it left damage behind"
    grep -q 'all is well' stderr.txt || broke "$1: something is missing"
    [ -z "$(ls -A store/temp)" ] || broke "$1: it left temporary files behind: $(ls -A store/temp)"
    [ -z "$(find store -name '.store-*')" ] || broke "$1: it left a header behind"
}

settings=()
rm -rf store
run env
[ "$code" = 0 ] || { cat stderr.txt && exit 1; }
cp -a store finished

faults=0
for phase in $phases; do
    [ "$phase" = cold ] || settings=(--set labels.classes=4)
    begin() {
        rm -rf store said.txt
        [ "$phase" = cold ] || cp -a finished store
    }
    begin
    run env LD_PRELOAD="$work/fault.so" FAULT_BELOW="$work/store" FAULT_SAY="$work/said.txt"
    digests >expected
    calls=$(sed -n 's/^calls //p' said.txt | tail -n 1)
    [ "$code" = 0 ] && [ -s expected ] && [ "$calls" -gt 50 ] || { cat stderr.txt && exit 1; }
    for error in $errors; do
        for at in $(seq $((every / 2 + 1)) "$every" "$calls"); do
            begin
            run env LD_PRELOAD="$work/fault.so" FAULT_BELOW="$work/store" FAULT_SAY="$work/said.txt" FAULT_AT="$at" FAULT_ERRNO="$error"
            faults=$((faults + 1))
            judge "$phase, error $error at call $at ($(sed -n 's/^fault //p' said.txt))"
        done
    done
    echo "$phase: $calls calls"
done
echo "$faults faults, $broken broken promises"
[ "$broken" = 0 ]
