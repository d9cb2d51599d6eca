# tests/<room>/*_test.cc -> one executable a room, oriel_test_<room>; every TEST is a ctest of its own, named
# <room>.<Suite>.<Sentence>. *_shared_test.cc needs the large data sets beside the project and is left out without them.

find_package(GTest QUIET)
if(NOT GTest_FOUND)
  message(STATUS "oriel: tests are not built (no GoogleTest)")
  return()
endif()
include(GoogleTest)

set(shared_data ${PROJECT_SOURCE_DIR}/../shared/data)
cmake_path(NORMAL_PATH shared_data)
if(EXISTS ${shared_data})
  set(ORIEL_HAS_SHARED_DATA TRUE)
else()
  set(ORIEL_HAS_SHARED_DATA FALSE)
  message(STATUS "oriel: tests on the large data sets are left out (no ../shared/data)")
endif()

# The precompiled header is made once, by a target that waits for nothing, and reused by all rooms (same flags).
function(oriel_test_pch target)
  if(NOT ORIEL_PCH)
    return()
  endif()
  if(NOT TARGET oriel_test_header)
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/oriel_test_header.cc CONTENT "")
    add_library(oriel_test_header OBJECT ${PROJECT_BINARY_DIR}/oriel_test_header.cc)
    oriel_test_flags(oriel_test_header)
    set_target_properties(oriel_test_header PROPERTIES POSITION_INDEPENDENT_CODE OFF)  # as the executables that use it:
    target_compile_options(oriel_test_header PRIVATE -fPIE)
    target_link_libraries(oriel_test_header PRIVATE GTest::gtest Eigen3::Eigen)
    target_precompile_headers(oriel_test_header PRIVATE <gtest/gtest.h> <Eigen/Dense> <algorithm> <cmath> <functional>
                              <iostream> <map> <memory> <random> <sstream> <string> <vector>)
  endif()
  target_precompile_headers(${target} REUSE_FROM oriel_test_header)
endfunction()

# As the library, but optimized less: most of what a test's file takes is the compilation of templates that run for
# milliseconds.
function(oriel_test_flags target)
  oriel_flags(${target})
  # At -O1 GCC 12 warns of sums of strings that are in order.
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1> -Wno-array-bounds -Wno-stringop-overflow)
endfunction()

# tests/support/*.cc: what several files of tests share, compiled once.
function(oriel_test_support)
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/support/*.cc)
  add_library(oriel_test_support STATIC ${sources})
  set_target_properties(oriel_test_support PROPERTIES POSITION_INDEPENDENT_CODE OFF)  # as what it is linked with
  target_compile_options(oriel_test_support PRIVATE -fPIE)
  oriel_test_flags(oriel_test_support)
  oriel_test_pch(oriel_test_support)
  target_include_directories(oriel_test_support PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(oriel_test_support PRIVATE oriel_core GTest::gtest Eigen3::Eigen)
endfunction()
oriel_test_support()

function(oriel_room_test room)
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/${room}/*_test.cc)
  if(NOT ORIEL_HAS_SHARED_DATA)
    list(FILTER sources EXCLUDE REGEX "_shared_test\\.cc$")
  endif()
  if(NOT sources OR (room STREQUAL "engines" AND NOT TARGET oriel_ceres))
    return()
  endif()
  set(target oriel_test_${room})
  add_executable(${target} ${sources})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  oriel_test_flags(${target})
  oriel_test_pch(${target})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${target} PRIVATE
    ORIEL_SOURCE_DIR="${PROJECT_SOURCE_DIR}" ORIEL_DATA_DIR="${PROJECT_SOURCE_DIR}/data"
    ORIEL_COMMAND="${PROJECT_BINARY_DIR}/oriel"
    $<$<BOOL:${ORIEL_HAS_SHARED_DATA}>:ORIEL_SHARED_DIR="${shared_data}">)
  if(TARGET oriel_ceres AND room STREQUAL "engines")
    target_link_libraries(${target} PRIVATE oriel_ceres)
  endif()
  # The rooms to the left of the files know nothing of them, in their tests too; so they are linked and run sooner.
  set(rooms_without_files base manifold sensor residual graph linear solve house)
  if(room IN_LIST rooms_without_files)
    oriel_links(${target} oriel_testing oriel_core)
  else()
    oriel_links_everything(${target})
  endif()
  target_link_libraries(${target} PRIVATE GTest::gtest GTest::gtest_main Eigen3::Eigen)
  if(nlohmann_json_FOUND)
    target_link_libraries(${target} PRIVATE nlohmann_json::nlohmann_json)
  endif()
  if(room STREQUAL "linear" OR room STREQUAL "solve")
    target_link_libraries(${target} PRIVATE oriel_test_support)
  endif()
  if(room MATCHES "^(solve|window|testing|run)$")
    target_link_libraries(${target} PRIVATE oriel_allocation_counter)
  endif()
  if(TARGET oriel_cli AND room STREQUAL "apps")
    add_dependencies(${target} oriel_cli)
    if(TARGET oriel_ceres_cli)
      add_dependencies(${target} oriel_ceres_cli)
    endif()
  endif()
  gtest_discover_tests(${target} TEST_PREFIX "${room}." DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT 300)
endfunction()

file(GLOB rooms RELATIVE ${PROJECT_SOURCE_DIR}/tests CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/*)
foreach(room IN LISTS rooms)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/tests/${room})
    oriel_room_test(${room})
  endif()
endforeach()

# Every example runs as a test.
file(GLOB examples CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/examples/*.cc)
foreach(example IN LISTS examples)
  cmake_path(GET example STEM name)
  if(TARGET oriel_example_${name})
    add_test(NAME example.${name} COMMAND oriel_example_${name} WORKING_DIRECTORY ${PROJECT_BINARY_DIR})
  endif()
endforeach()

# --- the house ----------------------------------------------------------------------------------------------------------

# Each header alone: one translation unit a header, which includes it twice (a guard is missing otherwise unseen). It is
# built by its test and not by `all`, so that one unfinished header does not stop every other test. Sanitizers would add
# time and find nothing more.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${oriel_source_root} ${oriel_source_root}/oriel/*.h)
if(NOT TARGET oriel_ceres)
  list(FILTER headers EXCLUDE REGEX "^oriel/engines/ceres/")
endif()
set(alone_sources "")
foreach(header IN LISTS headers)
  string(REPLACE "/" "_" unit ${header})
  set(unit ${PROJECT_BINARY_DIR}/headers_alone/${unit}.cc)
  file(CONFIGURE OUTPUT ${unit} CONTENT "#include \"${header}\"\n#include \"${header}\"\n")
  list(APPEND alone_sources ${unit})
endforeach()
if(alone_sources AND NOT ORIEL_SANITIZE)
  add_library(oriel_headers_alone OBJECT EXCLUDE_FROM_ALL ${alone_sources})
  oriel_flags(oriel_headers_alone)
  target_compile_options(oriel_headers_alone PRIVATE -O0)
  target_link_libraries(oriel_headers_alone PRIVATE Eigen3::Eigen)
  target_include_directories(oriel_headers_alone PRIVATE ${oriel_source_root})
  if(TARGET oriel_ceres)
    target_link_libraries(oriel_headers_alone PRIVATE Ceres::ceres)
  endif()
  add_test(NAME house.EachHeaderCompilesAlone
           COMMAND ${CMAKE_COMMAND} --build ${PROJECT_BINARY_DIR} --target oriel_headers_alone --parallel 2 -- -k 0)
  set_tests_properties(house.EachHeaderCompilesAlone PROPERTIES TIMEOUT 300 RUN_SERIAL ON)
endif()

# A project of somebody else finds the installed package, builds with its own flags and runs. Not with sanitizers: their
# runtime would have to be a flag of the consumer.
if(ORIEL_INSTALL AND NOT ORIEL_SANITIZE)
  add_test(NAME house.AnotherProjectFindsThePackage
           COMMAND ${CMAKE_COMMAND} -D BUILD_DIR=${PROJECT_BINARY_DIR} -D CONSUMER_DIR=${PROJECT_SOURCE_DIR}/tests/consumer
                   -D GENERATOR=${CMAKE_GENERATOR} -D COMPILER=${CMAKE_CXX_COMPILER}
                   -P ${PROJECT_SOURCE_DIR}/tests/house/package.cmake)
  set_tests_properties(house.AnotherProjectFindsThePackage PROPERTIES TIMEOUT 300)
endif()

# What a user waits for: the first program compiles and links within 3 s of CPU time at -O2. This test measures: it takes
# CPU time and not the clock's, the best of three, alone; a machine that runs at half its speed can still break it.
# Without the test: cmake --build BUILD --target first_program_time
if(EXISTS ${PROJECT_SOURCE_DIR}/examples/first_program.cc)
  set(first_program_command
      bash ${PROJECT_SOURCE_DIR}/tests/house/first_program.sh ${CMAKE_CXX_COMPILER}
      ${PROJECT_SOURCE_DIR}/examples/first_program.cc ${oriel_source_root} $<TARGET_FILE:oriel_core>
      ${PROJECT_BINARY_DIR}/first_program $<$<BOOL:${ORIEL_METIS_LIBRARY}>:-lmetis>)
  add_custom_target(first_program_time COMMAND ${first_program_command} DEPENDS oriel_core)
  if(CMAKE_BUILD_TYPE STREQUAL "Release" AND NOT ORIEL_SANITIZE)
    add_test(NAME house.TheFirstProgramCompilesInThreeSeconds COMMAND ${first_program_command})
    set_tests_properties(house.TheFirstProgramCompilesInThreeSeconds PROPERTIES RUN_SERIAL ON TIMEOUT 120)
  endif()
endif()

# A wrong type, arity or noise is one clear line from the compiler (V9).
if(NOT ORIEL_SANITIZE)
  add_test(NAME house.WrongFactorsAreClearCompileErrors
           COMMAND bash ${PROJECT_SOURCE_DIR}/tests/solve/compile_fail.sh ${CMAKE_CXX_COMPILER} ${oriel_source_root}
                   ${PROJECT_BINARY_DIR}/compile_fail)
  set_tests_properties(house.WrongFactorsAreClearCompileErrors PROPERTIES TIMEOUT 300)
endif()
