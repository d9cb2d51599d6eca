# What can be switched, and the flags that all of our own targets (and nobody else's) are compiled with.

set(ORIEL_ARCH native CACHE STRING "Instruction set of our own objects: native, x86-64-v3 or baseline")
set_property(CACHE ORIEL_ARCH PROPERTY STRINGS native x86-64-v3 baseline)
set(ORIEL_SANITIZE "" CACHE STRING "Sanitizers, as in -fsanitize=..., empty for none")
option(ORIEL_WERROR "Warnings are errors" OFF)
option(ORIEL_PCH "Precompile the heaviest system headers" ON)
option(ORIEL_CERES "Build engines/ceres and the benchmarks against Ceres where Ceres is found" ON)
option(ORIEL_APPS "Build the command" ${PROJECT_IS_TOP_LEVEL})
option(ORIEL_BENCHMARKS "Build the benchmarks" ${PROJECT_IS_TOP_LEVEL})
option(ORIEL_EXAMPLES "Build the examples" ${PROJECT_IS_TOP_LEVEL})
option(ORIEL_TESTS "Build the tests" ${PROJECT_IS_TOP_LEVEL})
option(ORIEL_FUZZERS "Build the libFuzzer programs of the readers (Clang alone; the preset fuzz)" OFF)
option(ORIEL_INSTALL "Install rules and the package for find_package(oriel)" ${PROJECT_IS_TOP_LEVEL})

set(oriel_archs native x86-64-v3 baseline)
if(NOT ORIEL_ARCH IN_LIST oriel_archs)
  message(FATAL_ERROR "ORIEL_ARCH=${ORIEL_ARCH}: expected native, x86-64-v3 or baseline")
endif()

if(PROJECT_IS_TOP_LEVEL)
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Kind of build" FORCE)
  endif()
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
  # -O1 keeps the linear algebra of a debug build bearable; asserts stay on.
  set(CMAKE_CXX_FLAGS_DEBUG "-O1 -g")
  set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
  find_program(ORIEL_CCACHE ccache)
  if(ORIEL_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
    # Without this sloppiness ccache refuses every file that uses a precompiled header.
    set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${ORIEL_CCACHE})
  endif()
endif()

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
# Hidden: a library that links ours statically does not hand our symbols, or our copies of inline functions, on.
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

# GCC tuned for Zen copies structs of 32-byte vectors in pieces of 16 bytes, which no load of the whole can be forwarded
# from. Vectors of AVX-512 are larger, and what GCC does there is not known to be wrong.
if(NOT ORIEL_ARCH STREQUAL "baseline")
  include(CheckCXXSourceCompiles)
  set(CMAKE_REQUIRED_FLAGS "-march=${ORIEL_ARCH} -mmove-max=256 -mstore-max=256")
  check_cxx_source_compiles("
    #if !defined(__AVX__) || defined(__AVX512F__)
    #error
    #endif
    int main() {}" oriel_avx_without_512)
  unset(CMAKE_REQUIRED_FLAGS)
endif()

# Flags are put on each target as PRIVATE options: nothing of this, above all no -march, reaches whoever links oriel.
function(oriel_flags target)
  # -fno-math-errno lets sqrt be one instruction and changes no result; -ffast-math would, so it is not here.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -fno-math-errno)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # GCC 12 takes _mm512_undefined_pd() of its own headers for an uninitialized variable (GCC bug 105593), sees
    # overlaps in adding a string to a literal (GCC bug 105651), and notes at every vector passed by value that its ABI
    # depends on the instruction set.
    target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized -Wno-restrict -Wno-psabi)
    if(ORIEL_PCH)
      target_compile_options(${target} PRIVATE -fpch-preprocess)  # ccache needs it to see into precompiled headers
    endif()
  endif()
  if(NOT ORIEL_ARCH STREQUAL "baseline")
    target_compile_options(${target} PRIVATE -march=${ORIEL_ARCH})
    if(oriel_avx_without_512)
      target_compile_options(${target} PRIVATE -mmove-max=256 -mstore-max=256)
    endif()
  endif()
  if(ORIEL_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(ORIEL_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${ORIEL_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${ORIEL_SANITIZE})
  endif()
endfunction()
