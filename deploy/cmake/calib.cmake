# Build conventions shared by every folder: calib_library(), calib_program(), calib_test(), calib_bench(), and how everything
# is compiled. There is one way of compiling (CMakePresets.json): users (deploy/quickstart) and developers (deploy/test) make the
# same objects, asserts among them, so that what is tested is what is run and nothing is compiled twice.
include(CTest)

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)  # calibctl finds calib-worker beside itself
set(THREADS_PREFER_PTHREAD_FLAG ON)
find_package(Threads REQUIRED)

find_program(CALIB_CCACHE ccache)
if(CALIB_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # What ccache asks for where headers are precompiled.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CALIB_CCACHE})
endif()

# Short files of one folder are compiled together, large headers of others once. Preset `alone` turns both off, so that each
# file is also seen alone.
if(NOT DEFINED CMAKE_UNITY_BUILD)
  set(CMAKE_UNITY_BUILD ON)
endif()

# One flag set for the whole tree. -ffp-contract=off: the same bits whatever the compiler fuses.
add_library(calib_flags INTERFACE)
target_compile_options(calib_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Werror -ffp-contract=off
  # g++ 12 sees overlaps and overruns in the standard library that are not there (GCC bugs 105651, 105329), and forgets in a
  # precompiled header that the library's insides are not ours.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;-Wno-stringop-overread;-Wno-stringop-overflow;-Wno-array-bounds>
  # Presets fuzz and tidy alone compile with clang++: what it warns of besides is clang-tidy's to say.
  $<$<CXX_COMPILER_ID:Clang>:-Wno-error;-Wno-unknown-pragmas>)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # g++ looks for memory to free again and again; from half a GB on is soon enough (9 % of the time of a large unit, 0.2 GB more).
  target_compile_options(calib_flags INTERFACE --param=ggc-min-heapsize=524288)
endif()
target_link_libraries(calib_flags INTERFACE Threads::Threads)
target_include_directories(calib_flags INTERFACE ${CMAKE_SOURCE_DIR} ${CMAKE_SOURCE_DIR}/deploy/cmake)  # calib/return_if_error.h

if(CALIB_THREAD_SANITIZER)
  # protobuf's headers give a MapField one member more where this macro is defined, and Debian's library is compiled without it.
  # libstdc++ makes the second of it, which says here that ThreadSanitizer watches.
  add_compile_options(-U__SANITIZE_THREAD__ -D_GLIBCXX_TSAN=1)
endif()

# calib_precompiled(NAME HEADERS <a> ... LINKS x ... [FLAGS ...]): headers compiled once for every target that names it after
# PRECOMPILED. The targets are linked to LINKS too, since the compiler takes precompiled headers only where macros agree.
function(calib_precompiled name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LINKS;FLAGS" ${ARGN})
  set(empty ${CMAKE_BINARY_DIR}/precompiled/${name}.cc)
  file(CONFIGURE OUTPUT ${empty} CONTENT "// compiles nothing but the headers\n")
  add_library(${name} OBJECT ${empty})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} calib_flags)
  target_compile_options(${name} PRIVATE ${ARG_FLAGS})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
  set_target_properties(${name} PROPERTIES CALIB_LINKS "${ARG_LINKS}")
endfunction()

function(calib_use_precompiled target name)
  get_target_property(links ${name} CALIB_LINKS)
  if(links)
    target_link_libraries(${target} PRIVATE ${links})
  endif()
  target_precompile_headers(${target} REUSE_FROM ${name})
endfunction()

# Compiles the sources of a target TOGETHER at a time, in the order in which they stand; names in anonymous namespaces then meet.
# Generated files and the files and folders after APART stay alone: folders of one file per name, whose files have the same names
# inside.
function(calib_compile_together target together apart)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_filename_component(folder ${source} DIRECTORY)
    if(IS_ABSOLUTE ${source} OR source IN_LIST apart OR (NOT folder STREQUAL "" AND folder IN_LIST apart))
      set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD_BATCH_SIZE ${together})
endfunction()

# calib_library(NAME SOURCES a.cc ... LINKS x ... [PRECOMPILED headers] [TOGETHER n] [APART a.cc ...]): a static library of this
# tree; sources by name, no globs (but effects: dem/CMakeLists.txt). n files are one unit (8).
function(calib_library name)
  cmake_parse_arguments(ARG "" "PRECOMPILED;TOGETHER" "SOURCES;LINKS;APART" ${ARGN})
  if(NOT ARG_TOGETHER)
    set(ARG_TOGETHER 8)
  endif()
  add_library(${name} STATIC ${ARG_SOURCES})
  calib_compile_together(${name} ${ARG_TOGETHER} "${ARG_APART}")
  target_link_libraries(${name} PUBLIC ${ARG_LINKS} PRIVATE calib_flags)
  target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR})
  if(ARG_PRECOMPILED)
    calib_use_precompiled(${name} ${ARG_PRECOMPILED})
  endif()
endfunction()

# calib_program(NAME SOURCES ... LINKS ... [PRECOMPILED headers]): an executable in <build>/bin.
function(calib_program name)
  cmake_parse_arguments(ARG "" "PRECOMPILED" "SOURCES;LINKS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES UNITY_BUILD OFF)
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} calib_flags)
  if(ARG_PRECOMPILED)
    calib_use_precompiled(${name} ${ARG_PRECOMPILED})
  endif()
endfunction()

# calib_test(NAME LABEL label SOURCES ... LINKS ... [TIMEOUT s] [TOGETHER n] [APART a.cc ...]): one GoogleTest binary, one ctest
# entry with a label (unit, property, verification, integration, fault, browser, data, layering, bench), or several:
# verification physics. Sources are compiled as those of libraries are.
function(calib_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT;TOGETHER" "LABEL;SOURCES;LINKS;APART" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  if(NOT ARG_TOGETHER)
    set(ARG_TOGETHER 8)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  calib_compile_together(${name} ${ARG_TOGETHER} "${ARG_APART}")
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} calib_test_main calib_flags)
  calib_use_precompiled(${name} calib_precompiled_tests)
  add_test(NAME ${name} COMMAND ${name})
  calib_set_test(${name} "${ARG_LABEL}" ${ARG_TIMEOUT})
endfunction()

# What ctest knows of a test that runs the target of its name.
function(calib_set_test name label timeout)
  # COST: the longest begin first, so that none is left to run alone at the end.
  set_tests_properties(${name} PROPERTIES LABELS "${label}" TIMEOUT ${timeout} COST ${timeout})
  if(CALIB_SLOWER)  # a sanitizer's preset says how many times
    math(EXPR slow "${CALIB_SLOWER} * ${timeout}")
    set_tests_properties(${name} PROPERTIES TIMEOUT ${slow})
  endif()
  if(CALIB_THREAD_SANITIZER)
    add_dependencies(${name} tsan_mutex)
    set_tests_properties(${name} PROPERTIES ENVIRONMENT
      "LD_PRELOAD=$<TARGET_FILE:tsan_mutex>;TSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/support/tsan.supp")
  endif()
endfunction()

# calib_fuzz(NAME SOURCES ... LINKS ...): a target of tests/fuzz. In preset fuzz the libFuzzer program fuzz_NAME; else one that
# ctest lets read every file of corpus/NAME (label fuzz).
function(calib_fuzz name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(fuzz_${name} ${ARG_SOURCES})
  set_target_properties(fuzz_${name} PROPERTIES UNITY_BUILD OFF)
  target_link_libraries(fuzz_${name} PRIVATE ${ARG_LINKS} calib_flags)
  if(CALIB_FUZZ)
    target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
    return()
  endif()
  target_link_libraries(fuzz_${name} PRIVATE calib_fuzz_replay)
  calib_use_precompiled(fuzz_${name} calib_precompiled_tests)
  add_test(NAME fuzz_${name} COMMAND fuzz_${name} ${CMAKE_CURRENT_SOURCE_DIR}/corpus/${name})
  calib_set_test(fuzz_${name} fuzz 60)
endfunction()

# calib_bench(NAME SOURCES ... LINKS ... [TINY filter]): a Google Benchmark binary; ctest runs TINY once so that it cannot rot.
function(calib_bench name)
  cmake_parse_arguments(ARG "" "TINY" "SOURCES;LINKS" ${ARGN})
  find_package(benchmark REQUIRED)
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES UNITY_BUILD OFF)
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} benchmark::benchmark calib_flags)
  if(ARG_TINY)
    add_test(NAME ${name} COMMAND ${name} --benchmark_filter=${ARG_TINY} --benchmark_min_time=0.001)
    set_tests_properties(${name} PROPERTIES LABELS bench TIMEOUT 120)
  endif()
endfunction()
