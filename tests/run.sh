#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is needed on Debian 12, builds everything, and runs all tests.
# Usage: tests/run.sh [arguments of ctest, for instance -R model/]
set -euo pipefail
cd "$(dirname "$0")/.."
. apps/setup.sh

install_build_packages
build all
say "Running all tests"
ctest --preset release -j "$(nproc)" "$@"
