#!/bin/sh
# What became of the job that was started in folder $1.
if [ ! -s "$1.code" ]; then
    echo running
elif [ "$(cat "$1.code")" = 0 ]; then
    echo success
else
    echo failed
fi
