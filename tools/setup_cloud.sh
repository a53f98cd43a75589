#!/bin/sh
# Fetch the packages of `make test-cloud` into folder $1 (.venv-cloud), to be read beside environment $2.
# Where they cannot be fetched, one sentence in $1.unavailable says why; tests that need them are skipped.
set -eu
folder=$1
python=$2
lock=$(dirname "$0")/../requirements.cloud.lock
rm -rf "$folder" "$folder.unavailable"
"$python" -m pip install --quiet --disable-pip-version-check --no-input --no-deps --require-hashes \
    --only-binary :all: --target "$folder" -r "$lock" 2>"$folder.log" || {
    echo "The packages for S3 and Kubernetes could not be fetched: $(grep -m 1 '^ERROR' "$folder.log" || tail -n 1 "$folder.log")" |
        tee "$folder.unavailable" >&2
}
