#!/usr/bin/env bash
# A study as a SLURM job array: each task computes a share of the parts, a last job joins them.
#   host/studies/cluster/slurm.sh STUDY PLACE [SHARES] [SBATCH-OPTION…]
#   host/studies/cluster/slurm.sh my-study.toml /home/group/my-study 100 --cpus-per-task=16 --time=4:00:00
# The job that joins the parts has --account, --partition and --qos of the options too.
# PLACE is a folder that all nodes see. The same command goes on where an earlier one was stopped.
# DAMPRIG names the command where it is not on the PATH of the nodes.
set -euo pipefail

if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then
    # A task of the array, which counts from 1.
    export RAYON_NUM_THREADS="${SLURM_CPUS_PER_TASK:-1}"
    exec "${DAMPRIG:-damprig}" study work "$1" --out "$2" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
fi
if [ "${DAMPRIG_STEP:-}" = merge ]; then
    exec "${DAMPRIG:-damprig}" study merge "$1" --out "$2"
fi

if [ $# -lt 2 ]; then
    echo "usage: $0 STUDY PLACE [SHARES] [SBATCH-OPTION…]" >&2
    exit 2
fi
study=$1 place=$2 shares=${3:-16}
shift 2
[ $# = 0 ] || shift
# A task whose node fails or that is preempted starts again and leaves out the parts that are there.
array=$(sbatch --parsable --job-name=damprig-study --array="1-$shares" --requeue "$@" "$0" "$study" "$place")
array=${array%%;*}
joining=() takes_value=
for option in "$@"; do
    case "$takes_value$option" in
        --account=* | --partition=* | --qos=* | -A?* | -p?* | -q?* | value*) joining+=("$option") takes_value= ;;
        --account | --partition | --qos | -A | -p | -q) joining+=("$option") takes_value=value ;;
    esac
done
merge=$(sbatch --parsable --job-name=damprig-merge --dependency="afterok:$array" --kill-on-invalid-dep=yes \
    --export=ALL,DAMPRIG_STEP=merge ${joining[@]+"${joining[@]}"} "$0" "$study" "$place")
echo "array $array of $shares shares, then job ${merge%%;*} joins them"
echo "how far they are: ${DAMPRIG:-damprig} study status $study --out $place"
