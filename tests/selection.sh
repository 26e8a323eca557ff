# The one selection of packages and features that the checks build, so that nothing is built twice: sourced by tests/run
# and tests/firmware.
# shellcheck shell=bash disable=SC2034
everything=(--locked --quiet --workspace --features damprig-core/fixed-point,damprig/probe)
