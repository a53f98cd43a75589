#!/bin/sh
# State of a job for Snakemake; the controller keeps finished jobs for MinJobAge seconds.
state=$(scontrol -o show job "$1" 2>/dev/null | sed -n 's/.*JobState=\([A-Z_]*\).*/\1/p')
case "$state" in
    COMPLETED) echo success ;;
    PENDING | CONFIGURING | COMPLETING | RUNNING | SUSPENDED | REQUEUED) echo running ;;
    *) echo failed ;;
esac
