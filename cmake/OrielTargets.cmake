# How the targets are made. A room that is still empty has no sources, and nothing of it is built.

set(oriel_source_root ${PROJECT_SOURCE_DIR}/src)

# All .cc and .h of the rooms named.
function(oriel_room_sources out)
  set(found "")
  foreach(room IN LISTS ARGN)
    file(GLOB room_files CONFIGURE_DEPENDS ${oriel_source_root}/oriel/${room}/*.cc ${oriel_source_root}/oriel/${room}/*.h)
    list(APPEND found ${room_files})
  endforeach()
  set(${out} ${found} PARENT_SCOPE)
endfunction()

# oriel_library(target [EXPORT_NAME name] SOURCES ...): a static library, whose headers are found as "oriel/room/x.h".
# The file's name is that of the exported target; the target itself must not be called `oriel`, the command's file is.
function(oriel_library target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "EXPORT_NAME" "SOURCES")
  add_library(${target} STATIC ${arg_SOURCES})
  set_target_properties(${target} PROPERTIES LINKER_LANGUAGE CXX ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${oriel_source_root}>
                                              $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  oriel_flags(${target})
  if(arg_EXPORT_NAME)
    add_library(oriel::${arg_EXPORT_NAME} ALIAS ${target})
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${arg_EXPORT_NAME})
  endif()
  if(arg_EXPORT_NAME STREQUAL "oriel")
    set_target_properties(${target} PROPERTIES OUTPUT_NAME oriel)
  endif()
endfunction()

# Eigen stays inside our .cc files, under a namespace of its own: our objects are compiled for another instruction set
# than those of whoever links us, and two copies of one inline function of Eigen, one of each, must never be merged
# (their packet sizes differ). The headers of Oriel do not include Eigen; tests/house checks that.
function(oriel_uses_private_eigen target)
  get_target_property(eigen_include Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  target_include_directories(${target} SYSTEM PRIVATE ${eigen_include})
  target_compile_definitions(${target} PRIVATE Eigen=oriel_eigen EIGEN_MAX_STATIC_ALIGN_BYTES=16)
endfunction()

# oriel_links(target library...): those of our libraries that there are.
function(oriel_links target)
  foreach(library IN LISTS ARGN)
    if(TARGET ${library})
      target_link_libraries(${target} PRIVATE ${library})
    endif()
  endforeach()
endfunction()

# Everything of ours that an executable of this tree may use.
function(oriel_links_everything target)
  oriel_links(${target} oriel_testing oriel_io oriel_core)
endfunction()

# The command: apps/*.cc -> build/<preset>/oriel
function(oriel_command)
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/apps/*.cc)
  find_package(CLI11 QUIET)
  find_package(fmt QUIET)
  if(NOT sources OR NOT TARGET oriel_io OR NOT CLI11_FOUND OR NOT fmt_FOUND)
    message(STATUS "oriel: the command is not built (it needs apps/*.cc, oriel::io, CLI11 and fmt)")
    return()
  endif()
  add_library(oriel_apps OBJECT ${sources})
  oriel_program(oriel_apps)
  target_compile_definitions(oriel_apps PRIVATE ORIEL_VERSION="${PROJECT_VERSION}")
  add_executable(oriel_cli ${PROJECT_SOURCE_DIR}/apps/engine/native.cc)
  set_target_properties(oriel_cli PROPERTIES OUTPUT_NAME oriel)
  oriel_program(oriel_cli)
  if(TARGET oriel_ceres)  # the same with one more engine, and its libraries
    add_executable(oriel_ceres_cli ${PROJECT_SOURCE_DIR}/apps/engine/ceres.cc)
    set_target_properties(oriel_ceres_cli PROPERTIES OUTPUT_NAME oriel-ceres)
    oriel_program(oriel_ceres_cli)
    oriel_links(oriel_ceres_cli oriel_ceres)
  endif()
endfunction()

function(oriel_program target)
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
  oriel_flags(${target})
  oriel_links_everything(${target})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE CLI11::CLI11 fmt::fmt nlohmann_json::nlohmann_json)
  if(NOT target STREQUAL oriel_apps)
    target_link_libraries(${target} PRIVATE oriel_apps oriel_allocation_counter)
  endif()
endfunction()

# benchmarks/*.cc: one executable each; benchmarks/support/*.cc belongs to those that race Ceres: `..._vs_ceres` and
# `versus_ceres`.
function(oriel_benchmarks)
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/benchmarks/*.cc)
  file(GLOB support CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/benchmarks/support/*.cc)
  foreach(source IN LISTS sources)
    cmake_path(GET source STEM name)
    if(name MATCHES "ceres" AND NOT TARGET oriel_ceres)
      message(STATUS "oriel: benchmark ${name} is not built (no Ceres)")
      continue()
    endif()
    add_executable(oriel_benchmark_${name} ${source})
    set_target_properties(oriel_benchmark_${name} PROPERTIES OUTPUT_NAME ${name}
                          RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/benchmarks)
    oriel_flags(oriel_benchmark_${name})
    target_include_directories(oriel_benchmark_${name} PRIVATE ${PROJECT_SOURCE_DIR})
    if(name MATCHES "ceres")
      target_sources(oriel_benchmark_${name} PRIVATE ${support})
      target_link_libraries(oriel_benchmark_${name} PRIVATE oriel_ceres)
    endif()
    oriel_links_everything(oriel_benchmark_${name})
    target_link_libraries(oriel_benchmark_${name} PRIVATE Eigen3::Eigen oriel_allocation_counter)
    if(nlohmann_json_FOUND)
      target_link_libraries(oriel_benchmark_${name} PRIVATE nlohmann_json::nlohmann_json)
    endif()
  endforeach()
endfunction()

# examples/*.cc: one executable each, compiled as a user would compile it: no flags of ours but the warnings.
function(oriel_examples)
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/examples/*.cc)
  foreach(source IN LISTS sources)
    cmake_path(GET source STEM name)
    add_executable(oriel_example_${name} ${source})
    set_target_properties(oriel_example_${name} PROPERTIES OUTPUT_NAME ${name}
                          RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/examples)
    target_compile_options(oriel_example_${name} PRIVATE -Wall -Wextra)
    oriel_links_everything(oriel_example_${name})
  endforeach()
endfunction()
