#!/bin/bash
# A Slurm of several nodes on one host, for tests: no systemd, no cgroups, no database, loopback only.
#   slurm.sh up | down | kill-node N [now] | start-node N | status
# `up` prints `export SLURM_CONF=…`, which sbatch and squeue need; it exits with 77 (skip) if something is missing.
# `kill-node N now` tells the controller; without `now` it finds out by itself, after some 10 seconds.
# Environment (BOX for all commands, the others for `up`):
#   BOX             state folder, made by `up`, removed by `down` (./slurm-box; at most 70 characters)
#   NODES CPUS MEM  nodes n1…, CPUs and MiB of each (3, 2, 1000); may be more than the host has
#   BASE_PORT       first of NODES + 1 ports (free ones)
#   MAX_ARRAY       MaxArraySize, one more than the largest index (1001)
#   MAX_JOBS MIN_JOB_AGE NODE_TIMEOUT KILL_WAIT
#                   MaxJobCount, MinJobAge, SlurmdTimeout, KillWait (10000, 300, 3, 2)
#   EXTRA           more lines of slurm.conf
# Partitions: main (default, no limits), short (2 minutes), urgent (requeues main's tasks to take their place).
set -euo pipefail

PATH=$PATH:/usr/sbin:/sbin
BOX=$(realpath -ms "${BOX:-slurm-box}")
export SLURM_CONF=$BOX/slurm.conf

die() { echo "slurm.sh: $1" >&2; exit "${2:-1}"; }

need() {
  local missing=() pair
  for pair in slurmctld:slurmctld slurmd:slurmd sinfo:slurm-client munged:munge; do
    type -P "${pair%:*}" >/dev/null || missing+=("package ${pair#*:}")
  done
  if [ "$(id -u)" != 0 ]; then missing+=(root)
  elif ! unshare --pid --uts --fork --kill-child --mount-proc true 2>/dev/null; then
    missing+=("the right to unshare (CAP_SYS_ADMIN)")
  fi
  [ ${#missing[@]} = 0 ] || die "missing:$(printf ' %s;' "${missing[@]}")" 77
}

# The first of $1 neighbouring ports that nobody listens on, below those the kernel hands out.
free_ports() {
  local base port
  for _ in {1..50}; do
    base=$((10000 + (RANDOM * 32768 + RANDOM) % 20000))
    for ((port = base; port < base + $1; port++)); do
      if (: <>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then continue 2; fi
    done
    echo $base; return
  done
  die "no free ports"
}

write_conf() {
  local cpus=${CPUS:-2} mem=${MEM:-1000} host base i
  host=$(uname -n); base=${BASE_PORT:-$(free_ports $((nodes + 1)))}
  cat >"$SLURM_CONF.new" <<CONF
ClusterName=box
SlurmctldHost=${host%%.*}(127.0.0.1)
SlurmctldPort=$base
SlurmUser=root
SlurmdUser=root
# A requeued task waits for cred_expire seconds; less than 5 is taken for 120.
AuthInfo=socket=$BOX/munge/sock,cred_expire=5
SlurmctldPidFile=$BOX/slurmctld.pid
SlurmdPidFile=$BOX/slurmd-%n.pid
StateSaveLocation=$BOX/state
SlurmdSpoolDir=$BOX/spool-%n
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
MpiDefault=none
MailProg=/bin/true
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1,bf_continue,default_queue_depth=1000
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
DefMemPerCPU=$((mem / cpus))
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
ReturnToService=2
# Also how long a client tries to reach a controller that is down, and a part of how long a lost node goes unnoticed.
MessageTimeout=3
MaxArraySize=${MAX_ARRAY:-1001}
MaxJobCount=${MAX_JOBS:-10000}
SlurmdTimeout=${NODE_TIMEOUT:-3}
MinJobAge=${MIN_JOB_AGE:-300}
KillWait=${KILL_WAIT:-2}
PartitionName=DEFAULT Nodes=ALL PriorityTier=1
PartitionName=main Default=YES
PartitionName=short MaxTime=2
PartitionName=urgent PriorityTier=9
$(for ((i = 1; i <= nodes; i++)); do
    echo "NodeName=n$i NodeHostname=n$i NodeAddr=127.0.0.1 Port=$((base + i)) CPUs=$cpus RealMemory=$mem"
  done)
${EXTRA:-}
CONF
  mv "$SLURM_CONF.new" "$SLURM_CONF"
}

# start NAME COMMAND…: in a PID namespace, whose end is the end of all that ran in it, tasks too.
start() {
  # shellcheck disable=SC2016 # for the inner shell, which names the host as the node and reaps orphans
  setsid unshare --pid --uts --fork --kill-child --mount-proc bash -c '
    case $0 in n[0-9]*) echo "$0" >/proc/sys/kernel/hostname;; esac
    trap "" HUP; "$@" & wait $!' "$@" </dev/null >>"$BOX/log/$1" 2>&1 &
  echo $! >"$BOX/pid/$1"; disown
}

start_node() {
  grep -qs "^NodeName=n$1 " "$SLURM_CONF" || die "no node $1 in $BOX"
  runs "n$1" || start "n$1" slurmd -D -N "n$1" -f "$SLURM_CONF"
}

# Whether NAME's namespace stands: its holder has $BOX in its command line, unlike a zombie or a reused number.
runs() {
  local pid; pid=$(cat "$BOX/pid/$1" 2>/dev/null) && grep -qsF "$BOX/" "/proc/$pid/cmdline"
}

# Returns when the namespace's first process is gone, and with it all others.
stop() {
  if runs "$1"; then
    local pid inner; pid=$(cat "$BOX/pid/$1"); inner=$(cat "/proc/$pid/task/$pid/children" 2>/dev/null || true)
    kill -9 "$pid" 2>/dev/null || true
    for _ in {1..200}; do
      runs "$1" || grep -qs '^State:[[:space:]]*[^ZX[:space:]]' "/proc/${inner% }/status" || break
      sleep 0.05
    done
  fi
  rm -f "$BOX/pid/$1"
}

up() {
  local i nodes=${NODES:-3}
  need
  [ ${#BOX} -le 70 ] || die "the path of BOX is too long for sockets in it: $BOX"
  if runs slurmctld; then echo "export SLURM_CONF=$SLURM_CONF"; return; fi
  down
  [ -z "$(ls -A "$BOX" 2>/dev/null)" ] || die "not empty and not a box: $BOX"
  mkdir -p "$BOX"/{state,munge,log,pid}; chmod 755 "$BOX" "$BOX/munge"
  write_conf
  (umask 077; head -c 1024 /dev/urandom >"$BOX/munge/key")
  start munged munged --foreground --force --num-threads=2 --socket="$BOX/munge/sock" --key-file="$BOX/munge/key" \
    --pid-file="$BOX/munge/pid" --log-file="$BOX/log/munged" --seed-file="$BOX/munge/seed"
  for _ in {1..100}; do [ ! -S "$BOX/munge/sock" ] || break; sleep 0.05; done
  start slurmctld slurmctld -D -c -f "$SLURM_CONF"
  for ((i = 1; i <= nodes; i++)); do start_node "$i"; done
  for _ in {1..150}; do
    runs slurmctld || break
    if [ "$(timeout 5 sinfo -h -N -p main -t idle -o %N 2>/dev/null | wc -l)" = "$nodes" ]; then
      echo "export SLURM_CONF=$SLURM_CONF"; return
    fi
    sleep 0.1
  done
  tail -n 15 "$BOX"/log/* >&2 || true
  down
  die "the nodes did not all become idle (logs above)"
}

down() {
  [ -d "$BOX/pid" ] || return 0
  local file
  for file in "$BOX"/pid/n* "$BOX"/pid/{slurmctld,munged}; do stop "${file##*/}"; done
  rm -rf "$BOX"
}

case "${1:-}:${2:-}" in
  up: | down:) "$1" ;;
  kill-node:[1-9]*)
    runs "n$2" || die "no running node $2 in $BOX"
    stop "n$2"
    if [ "${3:-}" = now ]; then scontrol update nodename="n$2" state=down reason=killed; fi ;;
  start-node:[1-9]*) start_node "$2" ;;
  status:) [ -d "$BOX/pid" ] || die "no box in $BOX"; sinfo -N -l; squeue -r ;;
  *) die "usage: slurm.sh up|down|kill-node N [now]|start-node N|status" 2 ;;
esac
