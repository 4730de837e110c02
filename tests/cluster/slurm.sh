#!/usr/bin/env bash
# A sweep under Slurm for real: munged, slurmctld and slurmd for this machine alone, on loopback, started and stopped
# here; four shards one at a time, of which one is cancelled and submitted again alone; merged; compared with the whole
# run. As root on Debian; installs slurm-wlm if it is not there. usage: tests/cluster/slurm.sh [RAYBENCH]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cluster=$here/../../harness/cluster
RAYBENCH=$(realpath "${1:-$here/../../build/release/raybench}")
export RAYBENCH
[ "$(id -u)" = 0 ] || { echo "slurm.sh: needs root, for slurmd" >&2; exit 2; }
if ! command -v slurmctld >/dev/null || ! command -v munged >/dev/null; then
  DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends slurm-wlm munge >/dev/null
fi

work=$(mktemp -d)
pids=()
finish() {
  local pid
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
  rm -rf "$work"
}
trap finish EXIT
mkdir -p "$work"/{munge,spool,state}
chmod 755 "$work"
chmod 700 "$work/munge"
dd if=/dev/urandom of="$work/munge/key" bs=128 count=1 status=none
chmod 400 "$work/munge/key"
# A port that nobody listens on, and the next one.
port=$((20000 + RANDOM % 20000))
cat >"$work/slurm.conf" <<CONF
ClusterName=raybench
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmUser=root
SlurmctldPort=$port
SlurmdPort=$((port + 1))
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CryptoType=crypto/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SchedulerType=sched/backfill
SelectType=select/cons_tres
MpiDefault=none
ReturnToService=2
KillWait=5
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES State=UP
CONF
export SLURM_CONF=$work/slurm.conf
munged --foreground --force --num-threads 2 --key-file "$work/munge/key" --socket "$work/munge/socket" \
  --pid-file "$work/munge/pid" --log-file "$work/munge/log" --seed-file "$work/munge/seed" 2>/dev/null &
pids+=($!)
slurmctld -D >/dev/null 2>&1 &
pids+=($!)
slurmd -D >/dev/null 2>&1 &
pids+=($!)

# until TIMES CONDITION...: asks every half second.
until_true() {
  local tries=$1
  shift
  while ! "$@"; do
    tries=$((tries - 1))
    if [ $tries -le 0 ]; then
      echo "slurm.sh: waited in vain for: $*" >&2
      tail -n 5 "$work"/*.log >&2 || true
      exit 1
    fi
    sleep 0.5
  done
}
is_up() { sinfo -h -o %t 2>/dev/null | grep -qx idle; }
is_idle() { [ -z "$(squeue -h 2>/dev/null)" ]; }
has_samples() { grep -qs '"kind":"sample"' "$work/out/2/journal/"*; }
submit() { sbatch --parsable --chdir "$work" --array="$1" "$cluster/raybench.sbatch" "$work/out" 4 --suite "$here/suite.toml"; }

until_true 120 is_up
job=$(submit "1-4%1")
until_true 600 has_samples
scancel "${job}_2"
until_true 1200 is_idle
open=$("$cluster/unfinished.sh" "$work/out" 4)
[ "$open" = 2 ] || { echo "slurm.sh: unfinished are '$open', not 2" >&2; cat "$work"/slurm-*.out >&2; exit 1; }
submit "$open" >/dev/null
until_true 1200 is_idle
[ -z "$("$cluster/unfinished.sh" "$work/out" 4)" ] || { echo "slurm.sh: not all ended" >&2; exit 1; }
"$RAYBENCH" merge "$work/merged" "$work"/out/{1,2,3,4} >/dev/null
"$RAYBENCH" run --suite "$here/suite.toml" --no-report --out "$work/whole" >/dev/null 2>&1
python3 "$here/same.py" "$work/whole" "$work/merged"
