#!/usr/bin/env bash
# Runs what the documentation tells people to run, so that it stays true. In README.md and
# docs/*.md, by the words after the fence:
#
#   ```sh test           the block must succeed
#   ```sh test data      the same, with the real data in MPC_DATA; skipped without it
#   ```cpp FILE          the block must stand in FILE, line by line (indentation aside)
#
# Shell blocks of one page run in order in a scratch folder that holds links to everything in the
# repository, so relative paths work and outputs stay out of the sources. The command `monoperfcap`
# is found in the build folder given as first argument (default build/release).
set -euo pipefail
cd "$(dirname "$0")/.."

root=$PWD
build=$(realpath "${1:-build/release}")
export PATH=$build/apps:$build/examples:$PATH
if [ -z "${MPC_DATA:-}" ] && [ -d ../shared/data ]; then
  MPC_DATA=$(realpath ../shared/data)
  export MPC_DATA
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

failures=0
fail() {
  echo "FAILED $1"
  failures=$((failures + 1))
}

# Writes every fenced block with a mark to $2/NNN.block, its first line "LINE INFO-STRING".
extract_blocks() {
  awk -v folder="$2" '
    !inside && /^```[a-z]+ ./ {
      inside = 1
      file = sprintf("%s/%03d.block", folder, ++n)
      print NR " " substr($0, 4) > file
      next
    }
    inside && /^```/ { inside = 0; close(file); next }
    inside { print > file }' "$1"
}

for page in README.md docs/*.md; do
  [ -e "$page" ] || continue
  blocks=$scratch/blocks/$page
  run=$scratch/run/$page
  mkdir -p "$blocks" "$run"
  ln -s "$root"/* "$run"
  extract_blocks "$page" "$blocks"
  for block in "$blocks"/*.block; do
    [ -e "$block" ] || continue
    read -r line language mark rest <"$block"
    place="$page:$line ($language $mark $rest)"
    tail -n +2 "$block" >"$block.text"
    case "$language $mark" in
      "sh test")
        if [ "$rest" = data ] && [ -z "${MPC_DATA:-}" ]; then
          echo "SKIPPED $place: set MPC_DATA"
          continue
        fi
        echo "running $place"
        (cd "$run" && bash -euo pipefail "$block.text" </dev/null) || fail "$place"
        ;;
      "cpp "*)
        echo "comparing $place"
        if ! awk '{ gsub(/^[ \t]+|[ \t]+$/, "") }
             NR == FNR { have[n++] = $0; next }
             { want[m++] = $0 }
             END {
               for (start = 0; start + m <= n; ++start) {
                 for (i = 0; i < m && have[start + i] == want[i]; ++i) {}
                 if (i == m) exit 0
               }
               exit 1
             }' "$mark" "$block.text"; then
          fail "$place: not the text of $mark"
        fi
        ;;
      *)
        fail "$place: unknown mark"
        ;;
    esac
  done
done
echo "check_docs.sh: $failures failed"
[ "$failures" -eq 0 ]
