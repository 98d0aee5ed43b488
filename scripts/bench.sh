#!/usr/bin/env bash
# Builds and runs the benchmarks and prints a Markdown table: time per call (median of three, CPU
# time of one thread) beside each baseline, and how many times faster than it.
#
#   scripts/bench.sh [library...]     such as `scripts/bench.sh skeleton pose`; default: all
#
# Names: benchmarks/README.md.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh
launcher=()
command -v ccache >/dev/null && launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
cmake --preset bench "${launcher[@]}" >&2
cmake --build --preset bench -j "$(nproc)" >&2

libraries=("$@")
if [ $# -eq 0 ]; then
  for source in benchmarks/*_benchmark.cc; do
    libraries+=("$(basename "$source" _benchmark.cc)")
  done
fi

printf 'Machine: %s; %s; %s.\n\n' "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)" \
  "$(c++ --version | head -1)" "$(date +%F)"
echo '| library | benchmark | time | baseline | its time | times faster |'
echo '|---|---|---:|---|---:|---:|'
for library in "${libraries[@]}"; do
  "build/bench/benchmarks/${library}_benchmark" --benchmark_format=csv \
    --benchmark_repetitions=3 --benchmark_report_aggregates_only=true 2>/dev/null |
    awk -F, -v library="$library" '
      function text(ns) {
        if (ns < 1e3) return sprintf("%.3g ns", ns)
        if (ns < 1e6) return sprintf("%.3g us", ns / 1e3)
        if (ns < 1e9) return sprintf("%.3g ms", ns / 1e6)
        return sprintf("%.3g s", ns / 1e9)
      }
      BEGIN { unit["ns"] = 1; unit["us"] = 1e3; unit["ms"] = 1e6; unit["s"] = 1e9 }
      # "Name",,,,,,,,true,"why it could not run"
      $9 == "true" && $1 !~ /_Baseline/ && !($1 in told) {
        told[$1] = 1
        name = $1
        gsub(/"|\/iterations:[0-9]+/, "", name)
        sub(/^.*,true,/, "")
        gsub(/"/, "")
        printf "| %s | %s | not run: %s | | | |\n", library, name, $0
      }
      # "Name/arguments_median",iterations,real_time,cpu_time,time_unit,...
      $1 ~ /_median"?$/ {
        name = $1
        gsub(/"|_median"?$|\/iterations:[0-9]+/, "", name)
        time[name] = $4 * unit[$5]
        order[n++] = name
      }
      END {
        for (i = 0; i < n; ++i) {
          name = order[i]
          subject = name
          if (sub(/_Baseline[^\/]*/, "", subject)) {
            if (subject in time) has_baseline[subject] = 1
          }
        }
        for (i = 0; i < n; ++i) {
          name = order[i]
          subject = name
          if (sub(/_Baseline[^\/]*/, "", subject) && subject in time) {
            printf "| %s | %s | %s | %s | %s | %.1f |\n", library, subject, text(time[subject]),
                   name, text(time[name]), time[name] / time[subject]
          } else if (!(name in has_baseline)) {
            printf "| %s | %s | %s | | | |\n", library, name, text(time[name])
          }
        }
      }'
done
