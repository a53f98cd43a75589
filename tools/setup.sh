#!/bin/sh
# Make the virtual environment $1; $2 is the Python to use. Versions are those of the lock file; with
# `latest` as $3, the newest that pyproject.toml allows.
# uv installs where it is at hand, else pip; both read their own settings (proxy, index, a folder of
# wheels: PIP_NO_INDEX=1 PIP_FIND_LINKS=folder, or UV_NO_INDEX=1 UV_FIND_LINKS=folder).
# On Debian and Ubuntu, system packages that are missing are installed (as root or through sudo).
set -eu
venv=$1
python=${2:-python3}
versions=${3:-locked}

install_packages() {
    command -v apt-get >/dev/null || { echo "Please install: $*" >&2; exit 1; }
    as_root=""
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || { echo "Please install (as root): $*" >&2; exit 1; }
        as_root=sudo
    fi
    echo "installing system packages: $*"
    $as_root apt-get update -qq
    DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

command -v "$python" >/dev/null || install_packages python3 python3-venv
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "Vermilion needs Python 3.11 or newer; found $("$python" --version). Set PYTHON=..." >&2
    exit 1
}
"$python" -c 'import ensurepip, venv' 2>/dev/null ||
    install_packages "python$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv"

install() {
    if command -v uv >/dev/null; then
        uv pip install --python "$venv/bin/python" --quiet "$@"
    else
        "$venv/bin/python" -m pip install --quiet --no-compile --use-pep517 --disable-pip-version-check --no-input "$@"
    fi
}

echo "setup: environment $venv with $("$python" --version)"
"$python" -m venv "$venv"
if [ "$versions" = latest ]; then
    echo "setup: the newest versions of all packages (a minute or two)"
    install -e '.[dev]'
else
    echo "setup: $(grep -c '^[a-z0-9].*==' requirements.lock) packages of requirements.lock (a minute or two)"
    install --require-hashes -r requirements.lock
    install --no-deps -e .
fi

# MeshLab's library needs OpenGL's shared objects, which servers often lack.
"$venv/bin/python" -c 'import pymeshlab' 2>/dev/null || {
    install_packages libgl1 libglu1-mesa libopengl0 libegl1
    "$venv/bin/python" -c 'import pymeshlab'
}

# Compiled by all cores at once, our own modules as well: a run has a process for each job, and where
# PYTHONDONTWRITEBYTECODE is set, as in many containers, each of them would compile all that it reads.
"$venv/bin/python" -m compileall -q -j 0 "$venv/lib" src >/dev/null 2>&1 || true
