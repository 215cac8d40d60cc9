# SPDX-License-Identifier: Apache-2.0
# Shared by apps/demo.sh, tests/run.sh and tests/accuracy.sh: source it with the
# repository as working folder. Installs packages of Debian 12 and builds.

say() { printf '\n== %s\n' "$*"; }

# Runs a command as root: directly, or through sudo.
as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    echo "sweepfit: error: neither root nor sudo to run: $*" >&2
    return 1
  fi
}

is_installed() {
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

# Installs those of the named packages that are missing.
install_packages() {
  local package missing=()
  for package in "$@"; do
    is_installed "$package" || missing+=("$package")
  done
  if [ "${#missing[@]}" -eq 0 ]; then
    say "Packages: all $# are installed"
    return
  fi
  say "Packages: installing ${missing[*]}"
  as_root apt-get update -q
  as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -q --no-install-recommends "${missing[@]}"
}

install_build_packages() {
  install_packages g++ cmake ninja-build ccache \
    libceres-dev libgoogle-glog-dev libeigen3-dev libsuitesparse-dev \
    libopencv-dev libopenvdb-dev libtbb-dev libboost-iostreams-dev zlib1g-dev \
    libblosc-dev libopenmesh-dev libcli11-dev libyaml-cpp-dev \
    nlohmann-json3-dev libtomlplusplus-dev libtinygltf-dev libembree-dev \
    libnanoflann-dev libwebp-dev libjemalloc-dev libgtest-dev libgmock-dev \
    libbenchmark-dev
}

# build TARGET...: configures the preset "release" and builds.
build() {
  say "Configuring (preset release)"
  cmake --preset release
  say "Building: $*"
  cmake --build --preset release --target "$@"
}
