#!/usr/bin/env bash
# A study through Slurm on this machine alone: daemons of its own in a folder, arrays below MaxArraySize, one task killed
# and healed by submitting again, and the same draws as a single process makes. Needs root and Debian's slurm-wlm.
# Usage: scripts/study/slurm.sh [METALITH] [FOLDER]
set -euo pipefail
cd "$(dirname "$0")/../.."
metalith=$(realpath "${1:-target/release/metalith}")
folder=${2:-target/slurm}
rm -rf "$folder"
mkdir -p "$folder"/{munge,state,spool}
folder=$(realpath "$folder")
chmod 700 "$folder/munge"

pids=()
cleanup() { for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done; }
trap cleanup EXIT

dd if=/dev/urandom of="$folder/munge/key" bs=128 count=1 status=none
chmod 400 "$folder/munge/key"
munged --force --foreground --key-file="$folder/munge/key" --socket="$folder/munge/socket" --pid-file="$folder/munge/pid" \
    --log-file="$folder/munge/log" --seed-file="$folder/munge/seed" &
pids+=($!)
cat >"$folder/slurm.conf" <<CONF
ClusterName=loopback
SlurmctldHost=localhost
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
MpiDefault=none
ReturnToService=2
MaxArraySize=17
JobRequeue=0
NodeName=localhost CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf
sleep 1
slurmctld -D 2>"$folder/slurmctld.err" &
pids+=($!)
sleep 2
slurmd -D -N localhost 2>"$folder/slurmd.err" &
pids+=($!)
for _ in $(seq 30); do sinfo -h -o %T 2>/dev/null | grep -q idle && break; sleep 1; done
sinfo

wait_for_jobs() { while [ -n "$(squeue -h)" ]; do sleep 1; done; }

sed "s#DESIGN#$PWD/designs/mini_3x3.toml#; s#^draws = .*#draws = 64#" scripts/study/tolerance.toml >"$folder/tolerance.toml"
cat >"$folder/cluster.toml" <<CONF
program = "$metalith"
time = "00:10:00"
cpus_per_task = 1
max_array_size = 17
CONF
"$metalith" study plan "$folder/tolerance.toml" --out "$folder/study" --draws-per-shard 1 --quiet
"$metalith" study submit "$folder/study" --slurm "$folder/cluster.toml"
# What is queued is left out: no job is new.
jobs=$(wc -l <"$folder/study/slurm/submitted.jsonl")
"$metalith" study submit "$folder/study" --slurm "$folder/cluster.toml"
[ "$(wc -l <"$folder/study/slurm/submitted.jsonl")" = "$jobs" ]
killed=
until [ -n "$killed" ]; do
    sleep 0.2
    killed=$(squeue -h -t running -o %i | tail -n 1)
done
echo "killing task $killed"
scancel --signal=KILL "$killed"
wait_for_jobs
"$metalith" study status "$folder/study"
"$metalith" study submit "$folder/study" --slurm "$folder/cluster.toml"
wait_for_jobs
"$metalith" study status "$folder/study"
"$metalith" study merge "$folder/study" --out "$folder/slurm.jsonl" --psfs 0

"$metalith" study plan "$folder/tolerance.toml" --out "$folder/alone" --draws-per-shard 64 --quiet
"$metalith" study run "$folder/alone" --missing --quiet
"$metalith" study merge "$folder/alone" --out "$folder/alone.jsonl" --psfs 0 --quiet
cmp "$folder/slurm.jsonl" "$folder/alone.jsonl" && echo "the draws are the same as those of one process"
