#!/bin/sh
# Make the environment of the landmark network in folder $1 (.venv-mediapipe); $2 is a Python to try first.
# The network is optional: where the environment cannot be made, one sentence says why, the file
# $1.unavailable keeps it, and the status is still 0.
set -eu
venv=$1
wanted=${2:-python3}
lock=$(dirname "$0")/../requirements.mediapipe.lock
runner=$(dirname "$0")/../src/vermilion/landmarks/mediapipe_runner.py

unavailable() {
    rm -rf "$venv"
    echo "$1" >"$venv.unavailable"
    echo "landmarks.detector 'mediapipe' is not available: $1" >&2
    exit 0
}

fits() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys, ensurepip, venv; sys.exit(not (3, 9) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null
}

python=""
for candidate in "$wanted" python3.12 python3.11 python3.10 python3.9 python3; do
    if fits "$candidate"; then python=$candidate; break; fi
done
[ -n "$python" ] || unavailable \
    "mediapipe 0.10.21 needs Python 3.9 to 3.12 with the module venv, and $wanted is $("$wanted" --version 2>&1). Install one of these and run tools/setup_landmarks.sh again."

echo "setup: the landmark network in $venv (half a minute)"
rm -rf "$venv" "$venv.unavailable"
"$python" -m venv "$venv" || unavailable "'$python -m venv $venv' failed."
# --no-deps: mediapipe declares jax and others, which its face mesh does not import.
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input --no-deps \
    --only-binary :all: --require-hashes -r "$lock" >"$venv/install.log" 2>&1 || {
    reason=$(grep -m 1 '^ERROR' "$venv/install.log" || tail -n 1 "$venv/install.log")
    unavailable "its packages could not be installed ($reason)."
}
"$venv/bin/python" -I "$runner" --check >"$venv/check.log" 2>&1 || {
    reason=$(tail -n 1 "$venv/check.log")
    unavailable "it does not run ($reason)."
}
