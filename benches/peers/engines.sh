#!/usr/bin/env bash
# Times trodden, DVC, Snakemake and, where R is installed, targets on one pipeline: twenty files are summed up one by one,
# the sums are gathered, and a report is made of them. The work is trivial, so that what is timed is the engine.
#
#   cargo build --release && benches/peers/engines.sh [ROUNDS]
#
# Cold, nothing changed, the last stage changed, one of twenty files changed; medians of the rounds, in turn. Installs its
# peers into environments of their own in a temporary folder.
set -euo pipefail
rounds=${1:-5}
root=$(cd "$(dirname "$0")/../.." && pwd)
trodden=${TRODDEN_BIN:-$root/target/release/trodden}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv env
env/bin/pip install --quiet --disable-pip-version-check "dvc==3.67.*" "snakemake>=9,<10"
dvc=$work/env/bin/dvc snakemake=$work/env/bin/snakemake
has_targets() { command -v Rscript >/dev/null && Rscript -e 'library(targets)' >/dev/null 2>&1; }

# The same files and scripts for everybody.
files() {
  mkdir -p days
  for day in $(seq -w 0 19); do seq 1 "$((10#$day + 100))" >"days/$day.csv"; done
  echo '{ sum += $1 } END { print sum }' >sum.awk
  echo '{ sum += $1 } END { print NR, sum }' >report.awk
}

mkdir trodden dvc snakemake targets
(cd trodden && files && cat >pipeline.yaml <<'YAML'
files: { days: "days/*.csv" }
stages:
  sums:
    use: command
    run: [sh, -c, "awk -f sum.awk {inputs.day} >{output}/sum"]
    deps: [sum.awk]
    inputs: { day: $files.days }
    output: files
  all:
    use: command
    run: [sh, -c, "cat {inputs.sums}/*/sum >{output}/all"]
    inputs: { sums: { all: sums } }
    output: files
  report:
    use: command
    run: [sh, -c, "awk -f report.awk {inputs.all}/all >{output}/report"]
    deps: [report.awk]
    inputs: { all: all }
    output: files
YAML
)
(cd dvc && files && git init -q . && "$dvc" init -q && "$dvc" config core.analytics false && cat >dvc.yaml <<'YAML'
stages:
  sums:
    foreach: [00, 01, 02, 03, 04, 05, 06, 07, 08, 09, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19]
    do:
      cmd: mkdir -p sums && awk -f sum.awk days/${item}.csv >sums/${item}
      deps: [sum.awk, "days/${item}.csv"]
      outs: ["sums/${item}"]
  all:
    cmd: cat sums/* >all
    deps: [sums]
    outs: [all]
  report:
    cmd: awk -f report.awk all >report
    deps: [report.awk, all]
    outs: [report]
YAML
# Its YAML reads 08 and 09 as text and 00 to 07 as numbers.
sed -i "s/foreach: .*/foreach: [$(seq -s, -w 0 19 | sed "s/[0-9]*/'&'/g; s/''//g")]/" dvc.yaml)
(cd snakemake && files && cat >Snakefile <<'SNAKE'
DAYS = [f"{day:02}" for day in range(20)]
rule report:
    input: "all", script="report.awk"
    output: "report"
    shell: "awk -f {input.script} {input[0]} >{output}"
rule gather:
    input: expand("sums/{day}", day=DAYS)
    output: "all"
    shell: "cat {input} >{output}"
rule sums:
    input: "days/{day}.csv", script="sum.awk"
    output: "sums/{day}"
    shell: "awk -f {input.script} {input[0]} >{output}"
SNAKE
)
(cd targets && files && cat >_targets.R <<'R'
library(targets)
list(
  tar_target(days, list.files("days", full.names = TRUE), format = "file"),
  tar_target(day, days, pattern = map(days), format = "file"),
  tar_target(sums, { system2("awk", c("-f", "sum.awk", day), stdout = TRUE) }, pattern = map(day)),
  tar_target(script, "report.awk", format = "file"),
  tar_target(report, system2("awk", c("-f", script), input = sums, stdout = TRUE))
)
R
)

run_trodden() { (cd trodden && "$trodden" run pipeline.yaml --quiet); }
run_dvc() { (cd dvc && "$dvc" repro -q); }
run_snakemake() { (cd snakemake && "$snakemake" --cores 2 --quiet all -- report >/dev/null 2>&1); }
run_targets() { (cd targets && Rscript -e 'targets::tar_make(reporter = "silent")' >/dev/null 2>&1); }
clean_trodden() { rm -rf trodden/artifacts; }
clean_dvc() { (cd dvc && rm -rf .dvc/cache .dvc/tmp dvc.lock sums all report); }
clean_snakemake() { (cd snakemake && rm -rf .snakemake sums all report); }
clean_targets() { rm -rf targets/_targets; }

engines=(trodden dvc snakemake)
has_targets && engines+=(targets) || echo "targets is not installed here: left out" >&2

# The shell's own clock: starting a program to ask for the time would take longer than what is timed.
timed() { local a=$EPOCHREALTIME; "run_$1"; local b=$EPOCHREALTIME; echo "$2 $1 $a $b"; }
for round in $(seq "$rounds"); do
  for engine in "${engines[@]}"; do "clean_$engine"; timed "$engine" cold; done
  for engine in "${engines[@]}"; do timed "$engine" nothing; done
  for engine in "${engines[@]}"; do
    # A change that changes the bytes of the script and of what comes out.
    echo "{ sum += \$1 } END { print NR, sum, $round }" >"$engine/report.awk"
    timed "$engine" last-stage
  done
  for engine in "${engines[@]}"; do
    seq 1 "$((round + 500))" >"$engine/days/07.csv"
    timed "$engine" one-of-twenty
  done
done >times

for engine in "${engines[@]}"; do
  [ "$engine" = targets ] && continue
  report=$(find "$engine" -name report -path '*report*' \( -type f -o -type l \) -not -path '*/.dvc/*' | head -1)
  echo "$engine: $(cat "$report")"
done
python3 - "${engines[@]}" <<'PY'
import statistics, sys
rows = {}
for line in open("times"):
    what, engine, a, b = line.split()
    rows.setdefault(what, {}).setdefault(engine, []).append(float(b) - float(a))
print(f"{'':16}" + "".join(f"{engine:>14}" for engine in sys.argv[1:]))
for what, engines in rows.items():
    cells = [f"{1e3 * statistics.median(engines[engine]):11.0f} ms" for engine in sys.argv[1:]]
    print(f"{what:16}" + "".join(cells))
PY
