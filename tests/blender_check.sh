#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Imports GLB files into Blender (headless) and compares what it shows with our
# skinning. Installs Blender. Not part of the tests: it is heavy.
# Usage: tests/blender_check.sh FILE.glb...
set -euo pipefail
cd "$(dirname "$0")/.."
. apps/setup.sh

if [ $# -eq 0 ]; then
  echo "usage: tests/blender_check.sh FILE.glb..." >&2
  exit 2
fi
install_packages blender
for file in "$@"; do
  say "$file"
  blender -b --factory-startup -noaudio --python-exit-code 1 \
    -P tests/blender_check.py -- "$(realpath "$file")" |
    grep -E "^(ok|FAILED|[0-9]+ checks|Traceback|  |[A-Za-z]*Error)"
done
