#!/bin/sh
# Make the virtual environment $1 with the locked versions; $2 is the Python to use.
# On Debian and Ubuntu, system packages that are missing are installed (as root or through sudo).
set -eu
venv=$1
python=${2:-python3}

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

"$python" -m venv "$venv"
quiet="--quiet --use-pep517 --disable-pip-version-check --no-input"
# shellcheck disable=SC2086
"$venv/bin/python" -m pip install $quiet --require-hashes -r requirements.lock
# shellcheck disable=SC2086
"$venv/bin/python" -m pip install $quiet --no-deps -e .

# MeshLab's library needs OpenGL's shared objects, which servers often lack.
"$venv/bin/python" -c 'import pymeshlab' 2>/dev/null || {
    install_packages libgl1 libglu1-mesa libopengl0 libegl1
    "$venv/bin/python" -c 'import pymeshlab'
}
