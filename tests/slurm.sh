#!/bin/sh
# A sweep as a job array of a real Slurm of one node, against the same sweep without it.
#   tests/slurm.sh [PROGRAM]      PROGRAM: target/debug/fillrate where it is left out
# Needs Debian's slurm-wlm and munge and root; without them it says so and ends with status 77.
set -eu
cd "$(dirname "$0")/.."
program=${1:-target/debug/fillrate}
for tool in munged slurmctld slurmd sbatch; do
    command -v $tool >/dev/null || { echo "left out: $tool is not installed (apt-get install slurm-wlm munge)"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "left out: a private Slurm must be started by root"; exit 77; }

D=$(mktemp -d)
H=$(hostname)
stop() {
    for service in slurmd slurmctld munged; do
        [ -f "$D/$service.pid" ] && kill "$(cat "$D/$service.pid")" 2>/dev/null || true
    done
    sleep 1
    rm -rf "$D"
}
trap stop EXIT
mkdir -p "$D/munge" "$D/state" "$D/spool" "$D/log"
chmod 700 "$D/munge"
head -c1024 /dev/urandom > "$D/munge/munge.key"
chmod 400 "$D/munge/munge.key"
munged --key-file="$D/munge/munge.key" --socket="$D/munge/munge.socket" --pid-file="$D/munged.pid" \
    --log-file="$D/log/munged.log" --seed-file="$D/munge/seed" --force
cat > "$D/slurm.conf" <<CONF
ClusterName=lab
SlurmctldHost=$H(127.0.0.1)
AuthType=auth/munge
AuthInfo=socket=$D/munge/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$D/state
SlurmdSpoolDir=$D/spool
SlurmctldPidFile=$D/slurmctld.pid
SlurmdPidFile=$D/slurmd.pid
SlurmctldLogFile=$D/log/slurmctld.log
SlurmdLogFile=$D/log/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$D/log/jobcomp.txt
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,sched_interval=5
ReturnToService=2
MpiDefault=none
SwitchType=switch/none
MaxArraySize=10001
NodeName=$H NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=1000 State=UNKNOWN
PartitionName=main Nodes=$H Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF="$D/slurm.conf"
slurmctld -c -f "$SLURM_CONF"
slurmd -f "$SLURM_CONF"

sweep() {
    "$program" sweep traces/cube --set scanout.enabled=false --vary texture.cache_lines=16..256*2 --vary pipelines=2,4 \
        --keep caches.texture "$@"
}
sweep --out "$D/shared" --slurm 4
sweep --out "$D/alone" > /dev/null
for _ in $(seq 120); do
    [ -f "$D/shared/report.md" ] && break
    sleep 1
done
if [ ! -f "$D/shared/report.md" ]; then
    echo "the jobs did not end in two minutes:"
    squeue
    cat "$D/shared/"*.log "$D/log/slurmctld.log" | tail -n 40
    exit 1
fi
for file in machines.csv machines.parquet long.csv long.parquet report.md; do
    cmp "$D/shared/$file" "$D/alone/$file"
done
cat "$D/log/jobcomp.txt" | sed -E 's/ (StartTime|EndTime|WorkDir|UserId|GroupId|SubmitTime|EligibleTime)=[^ ]*//g' | cut -c1-100
echo "four tasks of Slurm leave what one process leaves"
