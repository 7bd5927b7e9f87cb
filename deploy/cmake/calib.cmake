# Build conventions shared by every folder: calib_library(), calib_program(), calib_test(), calib_bench().
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
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CALIB_CCACHE})
endif()

# Shortens a first build; off where builds are incremental and ccache keeps objects.
option(CALIB_PRECOMPILE "precompile the large headers of others, compile short files together" OFF)

# One flag set for the whole tree. -ffp-contract=off: the same bits whatever the compiler fuses.
add_library(calib_flags INTERFACE)
target_compile_options(calib_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                                             -ffp-contract=off
                                             # g++ 12 at -O3 sees overlaps in std::string that are not there (GCC bug 105651)
                                             $<$<CONFIG:Release>:-Wno-restrict>)
target_compile_options(calib_flags INTERFACE -Werror)
if(CALIB_PRECOMPILE)
  # g++ 12 forgets there that standard headers are system headers, and warns of their insides. Names of one file's
  # anonymous namespace are seen by the next one.
  target_compile_options(calib_flags INTERFACE
    -Wno-shadow $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overread> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds>)
endif()
target_include_directories(calib_flags INTERFACE ${CMAKE_SOURCE_DIR} ${CMAKE_SOURCE_DIR}/deploy/cmake)  # calib/return_if_error.h

function(calib_precompile name)
  if(ARGN AND CALIB_PRECOMPILE)
    target_precompile_headers(${name} PRIVATE ${ARGN})
  endif()
endfunction()

# calib_library(NAME SOURCES a.cc ... LINKS x ... [PRECOMPILE <header> ...] [TOGETHER]): a static library of this tree; sources by
# name, no globs (but effects: dem/CMakeLists.txt). PRECOMPILE: large headers of others that most of its files include anyway.
# TOGETHER: its files are short beside what they include, and compiled several at a time where that is on; names in anonymous
# namespaces then meet.
function(calib_library name)
  cmake_parse_arguments(ARG "TOGETHER" "" "SOURCES;LINKS;PRECOMPILE" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  if(ARG_TOGETHER AND CALIB_PRECOMPILE)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
  endif()
  calib_precompile(${name} ${ARG_PRECOMPILE})
  target_link_libraries(${name} PUBLIC ${ARG_LINKS} PRIVATE calib_flags)
  target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR})
endfunction()

# calib_program(NAME SOURCES ... LINKS ...): an executable in <build>/bin.
function(calib_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} calib_flags)
endfunction()

# calib_test(NAME LABEL label SOURCES ... LINKS ... [TIMEOUT s] [APART]): one GoogleTest binary, one ctest entry with a label
# (unit, property, verification, integration, fault, browser, data, layering, bench), or several: verification physics.
# Where CALIB_PRECOMPILE is on, its files are compiled together but for those of APART, whose anonymous names would meet.
function(calib_test name)
  cmake_parse_arguments(ARG "APART" "TIMEOUT" "LABEL;SOURCES;LINKS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  find_package(GTest REQUIRED)
  if(NOT TARGET calib_test_main)
    add_library(calib_test_main STATIC ${CMAKE_SOURCE_DIR}/tests/support/main.cc)
    target_link_libraries(calib_test_main PUBLIC GTest::gmock GTest::gtest PRIVATE calib_flags)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  if(CALIB_PRECOMPILE AND NOT ARG_APART)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
  endif()
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} calib_test_main calib_flags)
  add_test(NAME ${name} COMMAND ${name})
  # COST: the longest begin first, so that none is left to run alone at the end.
  set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT ${ARG_TIMEOUT} COST ${ARG_TIMEOUT})
  if(CALIB_THREAD_SANITIZER)
    math(EXPR slow "4 * ${ARG_TIMEOUT}")  # scheduler_test takes 1300 s under it
    set_tests_properties(${name} PROPERTIES TIMEOUT ${slow})
    add_dependencies(${name} tsan_mutex)
    set_tests_properties(${name} PROPERTIES ENVIRONMENT
      "LD_PRELOAD=$<TARGET_FILE:tsan_mutex>;TSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/support/tsan.supp")
  endif()
endfunction()

# calib_bench(NAME SOURCES ... LINKS ... [TINY filter]): a Google Benchmark binary; ctest runs TINY once so that it cannot rot.
function(calib_bench name)
  cmake_parse_arguments(ARG "" "TINY" "SOURCES;LINKS" ${ARGN})
  find_package(benchmark REQUIRED)
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS} benchmark::benchmark calib_flags)
  if(ARG_TINY)
    add_test(NAME ${name} COMMAND ${name} --benchmark_filter=${ARG_TINY} --benchmark_min_time=0.001)
    set_tests_properties(${name} PROPERTIES LABELS bench TIMEOUT 120)
  endif()
endfunction()
