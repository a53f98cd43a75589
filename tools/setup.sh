#!/bin/sh
# Make the virtual environment $1; $2 is the Python to use. Versions are those of the lock file; with
# `latest` as $3, the newest that pyproject.toml allows.
# uv installs where it is at hand; it reads its own settings (UV_NO_INDEX=1 UV_FIND_LINKS=folder of wheels).
# Elsewhere uv is fetched for the time of the set-up: pip looks at every file that an index has of every
# package, and takes four times as long. Where pip has an index, a proxy or a folder of wheels of its own
# (PIP_NO_INDEX=1 PIP_FIND_LINKS=folder), or uv cannot be fetched or fails, pip installs.
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

has_settings() {
    "$venv/bin/python" -m pip config list 2>/dev/null |
        grep -Eq '\.(index-url|no-index|proxy|client-cert|trusted-host)='
}

fetch_uv() {
    "$venv/bin/python" -m pip install --quiet --no-compile --disable-pip-version-check --no-input --no-deps \
        --only-binary :all: --require-hashes --retries 1 --target "$venv/uv" \
        -r "$(dirname "$0")/../requirements.uv.lock" >/dev/null 2>&1
}

# `only`: uv is the user's own, and there is no other way; `first`: it was fetched, and pip follows.
install() {
    if [ "$uv" = only ]; then
        uv pip install --python "$venv/bin/python" --quiet "$@"
        return
    fi
    if [ "$uv" = first ]; then
        UV_SYSTEM_CERTS=1 "$venv/uv/bin/uv" pip install --python "$venv/bin/python" --quiet --no-cache --no-config "$@" && return
        echo "setup: uv failed; pip installs"
        uv=never
    fi
    "$venv/bin/python" -m pip install --quiet --no-compile --use-pep517 --disable-pip-version-check --no-input "$@"
}

echo "setup: environment $venv with $("$python" --version)"
"$python" -m venv "$venv"
if command -v uv >/dev/null; then
    uv=only
elif ! has_settings && fetch_uv; then
    uv=first
else
    uv=never
fi
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

rm -rf "$venv/uv"

# What a run imports is compiled once, and nothing else: where PYTHONDONTWRITEBYTECODE is set, as in many
# containers, each of its processes would compile all that it imports.
PYTHONDONTWRITEBYTECODE='' "$venv/bin/python" "$(dirname "$0")/import_all.py" >/dev/null 2>&1 || true
