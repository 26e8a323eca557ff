# Packages and features of the checks. Sourced by tests/run, tests/firmware and python/tests/run.
# shellcheck shell=bash disable=SC2034
# What is built and tested: the command as users build it, without the debug probe.
everything=(--locked --quiet --workspace --features damprig-core/fixed-point)
# What is linted and documented: with the debug probe, so that every line of the host is compiled in one of the two.
with_probe=(--locked --quiet --workspace --features damprig-core/fixed-point,damprig/probe)
