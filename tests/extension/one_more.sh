#!/usr/bin/env bash
# Adding a contact law, an effect, a lab test or an observable is writing one file: in a copy of the sources that has been
# configured before, the text KIND.cc.in becomes a file in the folder of its kind, the next build finds it, and a run of the
# engine that is linked with what that build makes of it lists it and uses it.
# usage: one_more.sh KIND SOURCE BUILD SCRATCH CMAKE_OPTION...   (KIND: effect, contact_law, lab_test, observable)
# SCRATCH/one_more.o and found.o are what BUILD's target run_one_more_KIND links before the library.
set -euo pipefail
kind=$1 source=$2 build=$3 scratch=$4
shift 4
case $kind in
  effect)      folder=effects              run=(hertz_mindlin oedometric one_more_effect) ;;
  contact_law) folder=contact/laws         run=(one_more_contact_law oedometric) ;;
  lab_test)    folder=lab_tests            run=(hertz_mindlin one_more_lab_test) ;;
  observable)  folder=measure/observables  run=(hertz_mindlin oedometric) ;;
  *) echo "no kind '$kind'" >&2; exit 2 ;;
esac
rm -rf "$scratch" && mkdir -p "$scratch/tree/deploy"
cp -r "$source/CMakeLists.txt" "$source/dem" "$source/inference" "$scratch/tree"
cp -r "$source/deploy/cmake" "$scratch/tree/deploy"
cmake -S "$scratch/tree" -B "$scratch/build" -G Ninja -DCALIB_SERVICE=OFF -DBUILD_TESTING=OFF -DCMAKE_UNITY_BUILD=OFF "$@" >"$scratch/configured"

cp "$source/tests/extension/$kind.cc.in" "$scratch/tree/dem/$folder/one_more_$kind.cc"
objects=dem/CMakeFiles/calib_dem.dir
list=found_${folder//\//_}.cc
ninja -C "$scratch/build" "$objects/$folder/one_more_$kind.cc.o" "$objects/$list.o" >"$scratch/compiled" || { cat "$scratch/compiled"; exit 1; }
cp "$scratch/build/$objects/$folder/one_more_$kind.cc.o" "$scratch/one_more.o"
cp "$scratch/build/$objects/$list.o" "$scratch/found.o"
cmake --build "$build" --target "run_one_more_$kind"
said=$("$build/bin/run_one_more_$kind" "${run[@]}")
without=$("$build/bin/run_scenario" hertz_mindlin oedometric)
rm "$build/bin/run_one_more_$kind"
value() { sed -n "s/^$2 //p" <<<"$1"; }
fail() { printf '%s\nIt said:\n%s\n' "$1" "$said"; exit 1; }
case $kind in
  effect)
    grep -qx 'effect one_more_effect: oedometric triaxial_drained triaxial_undrained' <<<"$said" || fail 'the effect is not listed with its tests'
    awk -v a="$(value "$said" axial_stress)" -v b="$(value "$without" axial_stress)" 'BEGIN { exit !(a - b > 0.99e5 && a - b < 1.01e5) }' ||
      fail 'the reading is not larger by 1e5 Pa' ;;
  contact_law)
    grep -qx 'contact one_more_contact_law' <<<"$said" || fail 'the law is not listed'
    awk -v a="$(value "$said" axial_stress)" 'BEGIN { exit !(a > 1e5) }' || fail 'compression does not raise the stress' ;;
  lab_test)
    grep -qx 'test one_more_lab_test' <<<"$said" || fail 'the test is not listed'
    awk -v a="$(value "$said" volumetric_strain)" 'BEGIN { exit !(a > 0.00599 && a < 0.00601) }' || fail 'the volume is not strained by three times 0.002' ;;
  observable)
    awk -v a="$(value "$said" one_more_observable)" 'BEGIN { exit !(a != "" && a > -1/3 && a < 2/3 && a != 0) }' || fail 'the observable is not read'
    [ "$(grep -v one_more_observable <<<"$said")" = "$without" ] || fail 'other readings changed' ;;
esac

# A name that nothing can have is refused when the build is configured.
touch "$scratch/tree/dem/$folder/Two-more.cc"
if cmake "$scratch/build" >"$scratch/refused" 2>&1 || ! grep -q "dem/$folder/Two-more.cc: the file has the name" "$scratch/refused"; then
  cat "$scratch/refused"
  echo "dem/$folder/Two-more.cc was not refused"
  exit 1
fi
rm -rf "$scratch"
