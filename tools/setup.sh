#!/usr/bin/env bash
# Usage: tools/setup.sh PYTHON VENV
# Makes the virtual environment with the pinned Python packages, and installs the Debian packages that the build
# and the pictures need: as root it installs them, else it names them.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:-}
venv=$2

# Package, and the check that tells whether what it brings is there already.
have_lib() { ldconfig -p | grep -q "$1"; }
missing=()
command -v cc >/dev/null || missing+=(gcc libc6-dev)                 # the linker that cargo calls
have_lib 'libGL\.so\.1' || missing+=(libgl1)                         # VTK, for the pictures
command -v chromium >/dev/null || missing+=(chromium)                 # the tests of the page for browsers
have_lib 'libEGL\.so\.1' || missing+=(libegl1)                       # VTK off screen
have_lib 'libXrender\.so\.1' || missing+=(libxrender1)               # VTK
ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 || missing+=(mesa-vulkan-drivers)   # a Vulkan adapter in software
if [ -n "$python" ] && ! "$python" -c 'import ensurepip' 2>/dev/null; then
    missing+=("python$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv")
fi
[ -n "$python" ] || missing+=(python3 python3-venv)

if [ ${#missing[@]} -gt 0 ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "setup: installing Debian packages: ${missing[*]}"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
    else
        echo "setup: these Debian packages are missing, and installing them takes root:" >&2
        echo "    sudo apt-get install ${missing[*]}" >&2
        case " ${missing[*]} " in
            *" gcc "*|*-venv*) exit 1 ;;       # nothing can be built without them
        esac
        echo "setup: going on without; pictures or GPU tests may not work" >&2
    fi
fi
[ -n "$python" ] || python=$(command -v python3)

for tool in cargo rustc; do
    command -v $tool >/dev/null || { echo "setup: $tool not found: install Rust 1.93 or newer" >&2; exit 1; }
done
"$python" - <<'PY'
import sys
if sys.version_info < (3, 11):
    sys.exit(f"setup: expected Python 3.11 or newer, got {sys.version.split()[0]} ({sys.executable}); "
             "name another one with make PYTHON=...")
PY

[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r python/requirements.txt
echo "setup: ready ($("$venv/bin/python" --version), $(rustc --version))"
