#!/bin/sh
# State of a job for Snakemake; the controller keeps finished jobs for MinJobAge seconds.
if job=$(scontrol -o show job "$1" 2>&1); then
    state=$(echo "$job" | sed -n 's/.*JobState=\([A-Z_]*\).*/\1/p')
else
    case "$job" in
        # The controller has forgotten the job: the accounting database knows, where there is one.
        *"Invalid job id"*) state=$(sacct -n -X -P -j "$1" -o State 2>/dev/null | sed 's/ .*//') ;;
        # It does not answer, as while it is started again: the job goes on meanwhile.
        *) state=UNKNOWN ;;
    esac
fi
case "$state" in
    COMPLETED) echo success ;;
    PENDING | CONFIGURING | COMPLETING | RUNNING | SUSPENDED | REQUEUED | UNKNOWN) echo running ;;
    *) echo failed ;;
esac
