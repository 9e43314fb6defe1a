#!/usr/bin/env bash
# Sets up, builds and runs all tests. The last line is "N passed, N failed, N skipped"; the exit status is 0 when none failed.
# AMBILUX_DATA: folder with scenes/ and mitsuba-tests/; tests that need it skip when it is unset.
# AMBILUX_LONG=1: also the tests labelled long, for which up to an hour must be allowed; they are left out otherwise.
# Arguments go to ctest, for example: scripts/test.sh -R bsdf
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
scripts/setup.sh
# The methods of the tutorials are tested as methods outside of the tree.
export AMBILUX_CMAKE_ARGS="-DAMBILUX_EXTENSIONS=examples/methods ${AMBILUX_CMAKE_ARGS:-}"
# shellcheck disable=SC2119  # the arguments are for ctest
configure_and_build

[[ -n ${AMBILUX_DATA:-} ]] || say "AMBILUX_DATA is not set: tests on the downloaded scenes are skipped (see docs/building.md)"
results="$build/test-results"
rm -rf "$results"
mkdir -p "$results"
selection=()
if [[ ${AMBILUX_LONG:-} != 1 ]]; then
  say "AMBILUX_LONG is not 1: tests labelled long are left out"
  selection=(-LE '^long$')
fi
status=0
ctest --test-dir "$build" --output-on-failure --no-tests=error -j "$(nproc)" \
  --output-junit "$results/ctest.xml" --test-output-size-passed 65536 "${selection[@]}" "$@" </dev/null || status=$?
# Each suite of Python keeps one core busy.
"$python" -m pytest -q -p no:cacheprovider python/ambilux/analysis --junitxml "$results/pytest.xml" </dev/null >"$results/pytest.log" 2>&1 &
analysis_tests=$!
python_tests=()
if [[ -d $build/python/ambilux ]]; then
  python_tests=("$results/python.xml")
  PYTHONPATH="$build/python" "$python" -m pytest -q -p no:cacheprovider python/tests --junitxml "${python_tests[0]}" </dev/null ||
    status=$?
fi
wait "$analysis_tests" || status=$?
cat "$results/pytest.log"
"$python" scripts/checks/count_tests.py "$results/ctest.xml" "$results/pytest.xml" "${python_tests[@]}" || status=1
exit "$status"
