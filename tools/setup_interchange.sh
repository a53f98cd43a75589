#!/bin/sh
# Make the environment of `make test-interchange` in folder $1 (.venv-interchange); $2 is a Python 3.11.
# Where a part cannot be made, one sentence in $1.unavailable says why; tests that need it are skipped.
set -eu
venv=$1
python=${2:-python3}
lock=$(dirname "$0")/../requirements.interchange.lock
validator=gltf-validator@2.0.0-dev.3.10

rm -rf "$venv" "$venv.unavailable"
unavailable() {
    echo "$1" >>"$venv.unavailable"
    echo "$1" >&2
}

"$python" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null || {
    unavailable "Blender's module 5.0.1 needs Python 3.11 with venv, and $python is $("$python" --version 2>&1). Give PYTHON=python3.11."
    exit 0
}
"$python" -m venv "$venv"
quiet="--quiet --disable-pip-version-check --no-input --no-deps --only-binary :all:"
# shellcheck disable=SC2086
"$venv/bin/python" -m pip install $quiet --require-hashes -r "$lock" 2>"$venv/install.log" ||
    unavailable "Blender's module could not be installed: $(grep -m 1 '^ERROR' "$venv/install.log" || tail -n 1 "$venv/install.log")"
# The project's own interpreter, with its own numpy, imports Alembic alone from here.
mkdir "$venv/alembic"
for part in "$venv"/lib/python*/site-packages/alembic3d* "$venv"/lib/python*/site-packages/imath*; do
    [ -e "$part" ] && ln -s "$(cd "$(dirname "$part")" && pwd)/$(basename "$part")" "$venv/alembic/"
done
if command -v npm >/dev/null && command -v node >/dev/null; then
    npm install --silent --no-fund --no-audit --prefix "$venv/node" "$validator" >"$venv/npm.log" 2>&1 ||
        unavailable "The glTF validator could not be installed: $(tail -n 1 "$venv/npm.log")"
else
    unavailable "The glTF validator needs node and npm."
fi
