# Sourced by run and test: virtual environments on a Debian or Ubuntu that has Python and nothing else.

# install PACKAGE: from the distribution, where that is possible without asking
install() {
    local root=()
    [ "$(id -u)" -eq 0 ] || root=(sudo -n)
    "${root[@]}" apt-get update -qq || true
    if ! "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$1" >/dev/null; then
        echo "$1 is missing; as root: apt-get install $1" >&2
        return 1
    fi
}

# make_environment FOLDER: a virtual environment, if there is none yet
make_environment() {
    [ -x "$1/bin/pip" ] && return
    if ! python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))'; then
        echo "Python 3.10 or later is needed, as the command python3" >&2
        return 1
    fi
    python3 -c 'import ensurepip' 2>/dev/null || install python3-venv
    # Pinocchio's wheel has all libraries but this one of the compiler
    python3 -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null || install libgomp1
    # the engine is compiled: that takes g++ and Python's headers
    if ! echo '#include <cmath>' | g++ -std=c++17 -fsyntax-only -x c++ - 2>/dev/null; then
        install g++ || return 1
    fi
    if ! python3 -c 'import os, sysconfig; open(os.path.join(sysconfig.get_path("include"), "Python.h"))' 2>/dev/null; then
        install python3-dev || return 1
    fi
    python3 -m venv "$1"
}
