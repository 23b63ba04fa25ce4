#!/usr/bin/env bash
# Kills runs of a small pipeline with SIGKILL at random moments, collects garbage after every tenth kill and runs them again;
# then starts two runs on one store at once.
#
#   tests/kill.sh target/release/trodden 50 "$(mktemp -d)"
#
# Arguments: the program, how many rounds, an empty folder to work in. A round is a fresh store, one to three kills, and a
# run to the end: it must end with the digests of an undisturbed run and find all that a killed run said it had made,
# `verify` must be clean, and nothing may be left of the dead. Exits with 1 at the first round that breaks a promise; its
# store stays in the folder.
set -euo pipefail

if [ $# -ne 3 ]; then
    sed -n '2,10s/^# \{0,1\}//p' "$0" >&2
    exit 2
fi
trodden=$(realpath "$1")
rounds=$2
mkdir -p "$3"
cd "$3"

cat >small.yaml <<'YAML'
seed: 7
crowd: &crowd { agents: [2, 4], radius: 0.2, duration: 10 }
maps:
  train: { homes: { count: 2, area: [50, 60] } }
  test: { homes: { count: 1, first: 1000, area: [50, 60] } }
stages:
  walks: { use: simulate, map: $maps, episodes: 45, <<: *crowd }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize, map: $maps, visits: visits, classes: 3 }
  tiles: { use: tile, map: $maps.train, labels: labels.train, size: 16, stride: 16, min_labeled: 64 }
  model: { use: train, tiles: tiles, epochs: 2 }
  heat: { use: annotate, map: $maps.test, model: model, stride: 16 }
  scores: { use: score, heat: heat, labels: labels.test, visits: visits.test }
  trips: { use: navigate, map: $maps.test, episodes: 5, steps: 20, <<: *crowd, agents: [5, 6] }
  costs: { use: cost, trips: trips, heat: heat }
YAML

fail() {
    echo "FAILED: $*" >&2
    exit 1
}

# run STORE OUT: runs the pipeline and keeps what it says.
run() {
    "$trodden" --store "$1" --json run small.yaml >"$2"
}

# digests OUT: the nodes that a run made or found, with their digests.
digests() {
    sed -n 's/^{"event":"node","node":"\([^"]*\)",.*"outcome":"\(ran\|hit\)","digest":"\([0-9a-f]\{64\}\)".*/\1 \3/p' "$1" | sort
}

# named OUTCOME OUT…: the nodes that runs said to have ended so.
named() {
    local outcome=$1
    shift
    sed -n 's/^{"event":"node","node":"\([^"]*\)",.*"outcome":"'"$outcome"'",.*/\1/p' "$@" | sort -u
}

# ran OUT: how many nodes it made.
ran() {
    sed -n 's/^{"event":"run","ran":\([0-9]*\),.*/\1/p' "$1"
}

# check STORE OUT WHAT: holds a finished run and its store against the promises.
check() {
    digests "$2" | cmp -s - expected || fail "$3 ended with other digests: compare $PWD/$2 with $PWD/expected"
    "$trodden" --store "$1" verify >verify.txt || fail "$3 left damage behind: $(cat verify.txt)"
    grep -q 'all is well' verify.txt || fail "$3: $(cat verify.txt)"
    [ -z "$(ls "$1/temp")" ] || fail "$3 left temporary files behind: $(ls "$1/temp")"
    [ -z "$(ls "$1/damaged")" ] || fail "$3 found something damaged: $(ls "$1/damaged")"
}

begun=${EPOCHREALTIME//[.,]/}
run undisturbed undisturbed.jsonl
length=$((${EPOCHREALTIME//[.,]/} - begun))
digests undisturbed.jsonl >expected
nodes=$(wc -l <expected)
[ "$nodes" -gt 0 ] && [ "$(ran undisturbed.jsonl)" = "$nodes" ] || fail "the undisturbed run ran $(ran undisturbed.jsonl) of $nodes nodes"
check undisturbed undisturbed.jsonl "the undisturbed run"

kills=0
collections=0
for round in $(seq 1 "$rounds"); do
    store=store-$round
    window=$length
    wanted=$((RANDOM % 3 + 1))
    hits=0
    : >made.jsonl
    while [ "$hits" -lt "$wanted" ]; do
        wait_us=$(((RANDOM * 32768 + RANDOM) % window))
        "$trodden" --store "$store" --json run small.yaml >killed.jsonl 2>killed.txt &
        pid=$!
        sleep "$((wait_us / 1000000)).$(printf '%06d' $((wait_us % 1000000)))"
        if kill -KILL "$pid" 2>kill.txt; then
            hits=$((hits + 1))
            cat killed.jsonl >>made.jsonl
            if [ $(((kills + hits) % 10)) = 0 ] && [ -d "$store" ]; then
                collections=$((collections + 1))
                "$trodden" --store "$store" gc --yes >gc.txt 2>&1 || grep -q 'there is no store' gc.txt ||
                    fail "round $round: gc failed: $(cat gc.txt)"
            fi
        else
            # It was through: begin the round anew, and be quicker.
            rm -rf "$store"
            : >made.jsonl
            window=$((window * 3 / 4 + 1))
            hits=0
        fi
        wait "$pid" 2>kill.txt || true
    done
    kills=$((kills + hits))
    run "$store" "$store.jsonl" || fail "round $round: the run after the kills failed, see $PWD/$store"
    check "$store" "$store.jsonl" "round $round"
    # The last line of a killed run may be cut short; then it has promised nothing.
    named ran made.jsonl | comm -12 - <(named ran "$store.jsonl") >again.txt
    [ ! -s again.txt ] || fail "round $round made again what a killed run had made: $(tr '\n' ' ' <again.txt)"
    rm -rf "$store" "$store.jsonl"
done
echo "$rounds rounds, $kills kills, $collections collections: the same digests for $nodes nodes each time, verify is clean"

run both one.jsonl &
one=$!
run both two.jsonl &
two=$!
wait "$one" || fail "the first of two runs at once failed"
wait "$two" || fail "the second of two runs at once failed"
check both one.jsonl "the first of two runs at once"
check both two.jsonl "the second of two runs at once"
sum=$(($(ran one.jsonl) + $(ran two.jsonl)))
[ "$sum" = "$nodes" ] || fail "two runs at once made $(ran one.jsonl) + $(ran two.jsonl) nodes, the pipeline has $nodes"
echo "two runs at once made $(ran one.jsonl) + $(ran two.jsonl) of $nodes nodes"
