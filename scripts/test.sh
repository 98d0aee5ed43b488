#!/usr/bin/env bash
# The whole check of the project, from a fresh Debian 12 machine on: installs what is missing,
# builds with warnings as errors, runs every test (unit, slow, data, blender), most unit tests under
# AddressSanitizer and UBSan (sanitized_tests), and the project's own checks (headers, consumers,
# format, docs).
# The last line is ctest's summary. Real data: MPC_DATA, else ../shared/data, else skipped.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh

jobs=$(nproc)
export CTEST_OUTPUT_ON_FAILURE=1 UBSAN_OPTIONS=print_stacktrace=1
export NODE_PATH=$PWD/build/tools/node_modules
launcher=()
command -v ccache >/dev/null && launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)

if [ ! -d "${MPC_DATA:-../shared/data}" ]; then
  echo "test.sh: NO REAL DATA: tests labelled 'data' are skipped; set MPC_DATA to its folder" >&2
fi

if ! scripts/get_models.sh; then
  echo "test.sh: NO NETWORKS: tests that run them are skipped" >&2
fi

cmake --preset release -DMPC_PROJECT_TESTS=ON "${launcher[@]}"
cmake --build --preset release -j "$jobs"
cmake --preset asan "${launcher[@]}"
cmake --build --preset asan -j "$jobs" --target sanitized_tests

log=build/test.log
status=0
ctest --preset release -j "$jobs" --timeout 1800 --no-tests=error 2>&1 | tee "$log" || status=$?
grep -E '^[0-9]+% tests passed' "$log" | tail -1 | grep . || echo "test.sh: ctest did not finish"
exit $status
