#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fits every capture of the given folders, pose by pose, with the default
# configuration, and checks speed, memory, accuracy and the files against the
# bars in tests/accuracy_table.py. Prints one table; the exit status is 1 when a
# bar is missed.
#
# Usage: tests/accuracy.sh [FOLDER...]
# A FOLDER holds captures or is one (default: ../shared/captures/dev and
# ../shared/captures/real/dancer, as far as present). Captures are also scored
# by an independent program, eval/score.py beside the folder `captures`, where
# there is one.
set -euo pipefail
here=$PWD
folders=()
for folder in "$@"; do folders+=("$(cd "$here" && realpath "$folder")"); done
cd "$(dirname "$0")/.."
. apps/setup.sh

if [ "${#folders[@]}" -eq 0 ]; then
  for folder in ../shared/captures/dev ../shared/captures/real/dancer; do
    if [ -d "$folder" ]; then folders+=("$(realpath "$folder")"); fi
  done
fi
if [ "${#folders[@]}" -eq 0 ]; then
  echo "accuracy.sh: no captures: name a folder" >&2
  exit 2
fi

install_build_packages
install_packages time python3 python3-numpy python3-scipy python3-opencv \
  python3-yaml
# Other sources of node bring npm with them.
command -v node >/dev/null || install_packages nodejs
command -v npm >/dev/null || install_packages npm
build sweepfit

validator=build/gltf-validator
if [ ! -d "$validator/node_modules/gltf-validator" ]; then
  say "Installing gltf-validator into $validator"
  mkdir -p "$validator"
  npm install --silent --no-fund --no-audit --prefix "$validator" gltf-validator
fi

captures=()
for folder in "${folders[@]}"; do
  if [ -f "$folder/capture.yaml" ]; then
    captures+=("$folder")
  else
    for file in "$folder"/*/capture.yaml; do captures+=("$(dirname "$file")"); done
  fi
done

say "Fitting ${#captures[@]} captures"
/usr/bin/python3 tests/accuracy_table.py --sweepfit build/release/sweepfit \
  --validator "$validator" --out build/accuracy "${captures[@]}"
