#!/usr/bin/env bash
# Builds what a release consists of: release/dist with wheel and source distribution, and release/sbom.cdx.json, the
# bill of materials of an installation with all extras. Usage: ci/release.sh v1.2.3
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python=${PYTHON:-python3}
version=${1:?the tag, as in: ci/release.sh v1.2.3}
version=${version#v}

"$python" -m venv "$folder/tools"
"$folder/tools/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt build cyclonedx-bom
# The archives have the time of the commit, whenever they are built.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct) "$folder/tools/bin/python" -m build --outdir release/dist .
if ! [[ -f release/dist/roaas-$version.tar.gz ]]; then
    echo "the tag $1 is not the version in pyproject.toml: built $(ls release/dist)" >&2
    exit 1
fi

"$python" -m venv "$folder/installed"
"$folder/installed/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
    "release/dist/roaas-$version-py3-none-any.whl[all]"
"$folder/installed/bin/python" -m pip uninstall --quiet --yes pip setuptools
"$folder/tools/bin/cyclonedx-py" environment --output-reproducible --output-format JSON \
    --output-file release/sbom.cdx.json "$folder/installed/bin/python"
sed -i "s#file://$PWD/release/dist/##" release/sbom.cdx.json
