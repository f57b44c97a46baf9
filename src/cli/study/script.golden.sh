#!/bin/bash
#SBATCH --job-name=gr__e_2
#SBATCH --array=0-39
#SBATCH --cpus-per-task=2
#SBATCH --requeue
#SBATCH --signal=B:TERM@60
#SBATCH --output=/dev/null
# 120 runs in 40 tasks, each with up to about 3 minutes of work on one core (a rough estimate)
# Add what your cluster asks for, such as --account, --partition, --time or --mem, as further lines
# `#SBATCH` or as options of sbatch. Submit the script again to execute what is missing.

seedbed='/opt/seed bed/bin/seedbed'
study="/home/o'neill/"'$HOME größe 2.ron'
folder='/scratch/50%/out'
logs="$folder/slurm"
report_log="$logs/${SLURM_ARRAY_JOB_ID}_report.out"

cd "/home/o'neill" || exit 1
mkdir -p "$logs" || exit 1
exec >>"$logs/${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID.out" 2>&1

# The first task submits the job that writes the report when all tasks have ended.
if [ "$SLURM_ARRAY_TASK_ID" = "${SLURM_ARRAY_TASK_MIN:-0}" ] && [ ! -e "$report_log" ]; then
    sbatch --job-name=gr__e_2-report --dependency="afterany:$SLURM_ARRAY_JOB_ID" \
        ${SLURM_JOB_ACCOUNT:+--account="$SLURM_JOB_ACCOUNT"} \
        ${SLURM_JOB_PARTITION:+--partition="$SLURM_JOB_PARTITION"} \
        --output="${report_log//%/%%}" <<'END_OF_REPORT_JOB' && : >>"$report_log" ||
#!/bin/sh
cd "/home/o'neill" || exit 1
exec '/opt/seed bed/bin/seedbed' report '/scratch/50%/out'
END_OF_REPORT_JOB
        echo "no job for the report was submitted: write it with \`seedbed report\` when all tasks have ended"
fi

# `exec`: Slurm signals the process of the script, which so is the program.
exec "$seedbed" study run "$study" --out "$folder" --quick \
    --jobs "${SLURM_CPUS_PER_TASK:-2}" --shard "$SLURM_ARRAY_TASK_ID/40"
