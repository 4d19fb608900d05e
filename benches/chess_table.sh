#!/usr/bin/env bash
# Relit pictures of the chess capture against its truth, beside the figures of the data's README. Usage:
#   benches/chess_table.sh DATA/chess-capture [FIELD]      (develops into a temporary folder without FIELD)
set -euo pipefail
data=$1
relumine=${RELUMINE:-$(dirname "$0")/../target/release/relumine}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
field=${2:-$work/chess.field}
[ -e "$field" ] || "$relumine" -q develop "$data" -o "$field"
figures() { # light, options → ratio / L2
  "$relumine" -q relight "$field" --light "$data/truth/$1.toml" -o "$work/out.exr" --force "${@:2}"
  "$relumine" compare "$work/out.exr" "$data/truth/$1.exr" --mask "$data/truth/mask.png" --json |
    sed -E 's/.*"relative_l2": ([0-9.]+), "ratio_of_means": ([0-9.]+).*/\2 \1/' | awk '{printf "%.3f / %.3f", $1, $2}'
}
printf '%-18s %-16s %-16s %-16s %-16s\n' light box 'README box' linear 'README linear'
while read -r light box_ratio box_l2 lin_ratio lin_l2; do
  printf '%-18s %-16s %-16s %-16s %-16s\n' "$light" \
    "$(figures "$light" --between box)" "$box_ratio / $box_l2" "$(figures "$light" --between linear)" "$lin_ratio / $lin_l2"
done <<'TABLE'
exact 1.000 .039 1.000 .039
const_upper 1.010 .042 1.014 .046
env_sky 1.001 .094 .998 .070
env_hard .979 .251 1.001 .154
spots .933 .595 .935 .405
spot_at_position .967 .386 .967 .386
area_near .950 .275 .957 .171
shafts .946 .676 .928 .673
directional 1.020 .441 .990 .257
spots_shifted .998 .401 1.025 .371
area_shifted .974 .270 .968 .169
TABLE
