#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is needed on Debian 12, builds sweepfit, and runs its demo: makes
# a synthetic capture, fits a body to it and compares it with the truth.
# Usage: apps/demo.sh [arguments of `sweepfit demo`]
set -euo pipefail
cd "$(dirname "$0")/.."
. apps/setup.sh

install_build_packages
build sweepfit
say "Running: sweepfit demo --out build/demo $*"
build/release/sweepfit demo --out build/demo "$@"
