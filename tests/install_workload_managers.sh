#!/usr/bin/env bash
# Installs what tests/workload_managers.rs needs, on Debian and Ubuntu: a Slurm that the test
# configures and starts for itself, and GNU parallel. No service has to run.
set -eu
apt-get update
apt-get install --yes --no-install-recommends slurmctld slurmd slurm-client munge parallel
