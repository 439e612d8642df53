#!/bin/bash
# The cases of a cohort as one job array of SLURM, without an engine: each task computes every N-th case.
#   sbatch --array=0-199 workflows/slurm-array.sh IN OUT [OPTIONS]
# then, once it has ended: glioscope cohort IN OUT group
#SBATCH --cpus-per-task=2
#SBATCH --mem=2G
#SBATCH --time=04:00:00
set -euo pipefail
input=$1 output=$2
shift 2
# Only the labels: a list in the shell's own array, so that names with spaces stay whole.
mapfile -t labels < <("${GLIOSCOPE:-glioscope}" cohort "$input" "$output" participant --list)
own=()
for ((n = SLURM_ARRAY_TASK_ID; n < ${#labels[@]}; n += SLURM_ARRAY_TASK_COUNT)); do own+=("${labels[n]}"); done
((${#own[@]})) || exit 0
# On the node's own disk first; copied to OUT when a case is whole.
exec "${GLIOSCOPE:-glioscope}" cohort "$input" "$output" participant "$@" --n-procs 1 --mem-mb "${SLURM_MEM_PER_NODE:-2048}" \
    -w "${SLURM_TMPDIR:-${TMPDIR:-/tmp}}" --participant-label "${own[@]}"
