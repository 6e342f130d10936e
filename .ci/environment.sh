# Sourced by run and test: virtual environments on a Debian or Ubuntu that has Python and nothing else.

# install PACKAGE...: from the distribution, where that is possible without asking
install() {
    if [ "$(id -u)" -eq 0 ]; then
        apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null
    else
        sudo -n apt-get update -qq && sudo -n apt-get install -y -qq "$@" >/dev/null
    fi
}

# make_environment FOLDER: a virtual environment, if there is none yet
make_environment() {
    [ -x "$1/bin/pip" ] && return
    if ! python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))'; then
        echo "Python 3.10 or later is needed, as the command python3" >&2
        return 1
    fi
    if ! python3 -c 'import ensurepip' 2>/dev/null && ! install python3-venv; then
        echo "Python's module venv is missing; as root: apt-get install python3-venv" >&2
        return 1
    fi
    python3 -m venv "$1"
}
