#!/usr/bin/env bash
# Adding an effect is writing one file: in a copy of the sources that has been configured before, a new file in dem/effects is found
# by the next build, and `calibctl effects` linked with what that build makes of it lists the effect.
# usage: one_more_effect.sh SOURCE BUILD SCRATCH CMAKE_OPTION...
# SCRATCH/one_more_effect.o and effect_list.o are what BUILD's target calibctl_one_more_effect links.
set -euo pipefail
source=$1 build=$2 scratch=$3
shift 3
rm -rf "$scratch" && mkdir -p "$scratch/tree/deploy"
cp -r "$source/CMakeLists.txt" "$source/dem" "$source/inference" "$scratch/tree"
cp -r "$source/deploy/cmake" "$scratch/tree/deploy"
cmake -S "$scratch/tree" -B "$scratch/build" -G Ninja -DCALIB_SERVICE=OFF -DBUILD_TESTING=OFF "$@"

cat >"$scratch/tree/dem/effects/one_more_effect.cc" <<'CC'
// `one_more_effect`: readings of load that are too large by a constant.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// Vanishes at 0.
EffectEntry OneMoreEffect() {
  ParameterInfo shift;
  shift.name = "shift";
  shift.unit = std::string("Pa");
  shift.max = 1e9;
  shift.default_prior = {.kind = "uniform", .min = 0, .max = 1e5};
  shift.null_value = 0;
  shift.description = "added to each reading";
  return {.info = {.name = "one_more_effect",
                   .kind = "measurement",
                   .description = "Readings of load are too large by a constant",
                   .contacts = {},
                   .parameters = {shift},
                   .reference = "this test",
                   .rays = {{.parameter = "shift", .steps = {1e3, 1e4}}}},
          .alter = [](const ParameterSet& parameters, Apparatus& apparatus) {
            apparatus.load_offset += parameters.Get("shift");
          }};
}

}  // namespace calib::dem
CC
objects=dem/CMakeFiles/calib_dem_catalog.dir
ninja -C "$scratch/build" $objects/effects/one_more_effect.cc.o $objects/effect_list.cc.o
cp "$scratch/build/$objects/effects/one_more_effect.cc.o" "$scratch/one_more_effect.o"
cp "$scratch/build/$objects/effect_list.cc.o" "$scratch/effect_list.o"
cmake --build "$build" --target calibctl_one_more_effect
listed=$("$build/bin/calibctl_one_more_effect" effects)
rm "$build/bin/calibctl_one_more_effect"
# After all others, whose places come before those of an entry that states none.
last=$(grep -oE '^[a-z_]+ \(' <<<"$listed" | tail -1)
if [ "$last" != 'one_more_effect (' ] || ! grep -q 'shift' <<<"$listed"; then
  printf 'calibctl effects does not end with one_more_effect:\n%s\n' "$listed"
  exit 1
fi

# A name that no effect can have is refused when the build is configured.
touch "$scratch/tree/dem/effects/Two-more.cc"
if cmake "$scratch/build" >"$scratch/refused" 2>&1 || ! grep -q "dem/effects/Two-more.cc: the file of an effect" "$scratch/refused"; then
  cat "$scratch/refused"
  echo 'dem/effects/Two-more.cc was not refused'
  exit 1
fi
rm -rf "$scratch"
