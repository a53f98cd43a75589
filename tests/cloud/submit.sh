#!/bin/sh
# Starts the job script $1 as on another machine: in an empty folder, with no variable of its run. Prints the folder.
set -eu
folder=$(mktemp -d "$MACHINES/XXXXXX")
cp "$1" "$folder.sh"
(
    cd "$folder"
    code=0
    env -i PATH="$PATH" PYTHONPATH="$PYTHONPATH" HOME="$MACHINES" sh "$folder.sh" >"$folder.log" 2>&1 || code=$?
    rm -rf "$folder"
    echo "$code" >"$folder.code"
) </dev/null >/dev/null 2>&1 &
echo "$folder"
