#!/usr/bin/env bash
# Sets up and builds (Release, in build/). Arguments are targets, for example: scripts/build.sh ambilux
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
scripts/setup.sh
configure_and_build "$@"
