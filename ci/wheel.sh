#!/usr/bin/env bash
# Installs the wheel alone, judges a device with it, and runs the tests that need neither ROS nor a browser.
# Usage: ci/wheel.sh PYTHON
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
device=
cleanup() {
    if [[ -n $device ]]; then kill "$device"; fi
    rm -rf "$folder"
}
trap cleanup EXIT

install() { # NAME WHAT...: makes a virtual environment with these packages
    "$python" -m venv "$folder/$1"
    "$folder/$1/bin/python" -m pip install --quiet --disable-pip-version-check "${@:2}"
}

python=${1:-python3}
install dev '.[all,dev]'
"$folder/dev/bin/python" -m build --wheel --outdir "$folder/dist" .
install base "$folder"/dist/*.whl

port=${ROAAS_PORT:-8099}
"$folder/dev/bin/python" tests/conformance/described_devices/rig.py --port "$port" &
device=$!
description=http://127.0.0.1:$port/openapi.json
for _ in {1..100}; do
    if "$folder/dev/bin/python" -c "import urllib.request as u; u.urlopen('$description', timeout=1)" 2>/dev/null; then break; fi
    sleep 0.2
done
"$folder/base/bin/roaas" certify "$description" --effort quick --out "$folder/out"

"$folder/dev/bin/python" -m pytest -q tests/conformance/{commandline,contract,statement,documents,transport,verdict} \
    tests/conformance/{observe,soap,scenarios} tests/reports/{certificate,fleet,formats} tests/ci/test_wheel.py \
    tests/test_front_door.py
