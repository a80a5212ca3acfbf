#!/bin/sh
# make_venv.sh PYTHON VENV PIP_ARGUMENT...: make the virtual environment if there is none, then install into it.
set -eu
python=$1
venv=$2
shift 2
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "thermocomp needs Python >= 3.11; $python is $("$python" --version 2>&1). Set another: make PYTHON=python3.12" >&2
    exit 2
}
if [ ! -x "$venv/bin/pip" ]; then
    # Debian ships Python without ensurepip; the package that brings it has the version in its name.
    "$python" -c 'import ensurepip' 2>/dev/null ||
        "$(dirname "$0")/system_packages.sh" "$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
    "$python" -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check 'pip>=25.1'
fi
exec "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
