# Packages and features that all checks build, so that nothing is built twice. Sourced by tests/run and tests/firmware.
# shellcheck shell=bash disable=SC2034
everything=(--locked --quiet --workspace --features damprig-core/fixed-point,damprig/probe)
