#!/usr/bin/env bash
# Builds the wheel as `cargo build --release` builds the program, on the same compiled dependencies; installs it where there
# is nothing else, lets it tell the README's story there, and holds it against its command; then beside the libraries of
# `requirements.txt`, which are to be in `.venv`.
#
#     tests/python/wheel.sh [ARGUMENT OF MATURIN…]
set -euo pipefail
cd "$(dirname "$0")/../.."
root=$PWD
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

(cd src/python && "$root/.venv/bin/maturin" build --quiet --release --locked --out "$place/wheel" "$@")
wheel=$(echo "$place"/wheel/*.whl)
echo "${wheel##*/}: $(stat -c %s "$wheel") bytes"

python3 -m venv "$place/empty"
"$place/empty/bin/pip" install --quiet --disable-pip-version-check "$wheel"
others=$("$place/empty/bin/pip" --disable-pip-version-check list --format freeze --exclude pip --exclude setuptools | cut -d= -f1 | sort | xargs)
[ "$others" = "numpy trodden" ] || { echo "with it came more than numpy: $others" >&2; exit 1; }
cd "$place"
PATH="$place/empty/bin:$PATH" python "$root/tests/python/story.py" "$place/story"
PATH="$place/empty/bin:$PATH" python "$root/tests/python/package.py"

# As it is, for an environment that has the libraries; nothing is added to that.
"$root/.venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --target "$place/beside" "$wheel"
PATH="$place/empty/bin:$PATH" PYTHONPATH="$place/beside" "$root/.venv/bin/python" "$root/tests/python/libraries.py"
