#!/usr/bin/env bash
# A study on several machines with GNU parallel over ssh: workers that take one missing part after the other, then the table.
#   host/studies/cluster/gnu-parallel.sh STUDY PLACE [WORKERS] [PARALLEL-OPTION…]
#   host/studies/cluster/gnu-parallel.sh my-study.toml /home/group/my-study 8 --sshlogin 4/node1,4/node2 --workdir .
# Without --sshlogin all workers run on this machine. PLACE is a folder that all machines see, or the URL of an object store.
# DAMPRIG names the command, RAYON_NUM_THREADS the threads of each worker (1).
set -euo pipefail

if [ $# -lt 2 ]; then
    echo "usage: $0 STUDY PLACE [WORKERS] [PARALLEL-OPTION…]" >&2
    exit 2
fi
study=$1 place=$2 workers=${3:-$(nproc)}
shift 2
[ $# = 0 ] || shift
damprig=${DAMPRIG:-damprig}
export RAYON_NUM_THREADS="${RAYON_NUM_THREADS:-1}"
# A worker that fails is started again. The lines of each begin with its number.
seq "$workers" | parallel --max-args 0 --quote --jobs "$workers" --env RAYON_NUM_THREADS --retries 3 --line-buffer \
    --tagstring 'worker {#}' "$@" "$damprig" study work "$study" --out "$place" --claim
"$damprig" study merge "$study" --out "$place"
