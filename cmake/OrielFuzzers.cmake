# fuzz/*_fuzzer.cc: one libFuzzer program each, build/fuzz/fuzzers/<name>. Only Clang has libFuzzer; the preset `fuzz`
# configures for it, and `./test --fuzz [SECONDS]` builds the target `oriel_fuzzers` and runs them.
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  message(FATAL_ERROR "ORIEL_FUZZERS: expected Clang, found ${CMAKE_CXX_COMPILER_ID}; use the preset fuzz")
endif()

# The readers and what they stand on, and no more: Debian's Clang 14 cannot deduce the arguments of aggregates (Prior{x}),
# which the rooms further to the right do.
oriel_room_sources(fuzzed_sources base manifold sensor residual graph io)
list(FILTER fuzzed_sources EXCLUDE REGEX "/io/(journal|replay|run_config.*|setting_text|loss_text)\\.cc$")
list(APPEND fuzzed_sources ${oriel_source_root}/oriel/window/visual_map.cc)
oriel_library(oriel_fuzzed SOURCES ${fuzzed_sources})
oriel_uses_private_eigen(oriel_fuzzed)
target_link_libraries(oriel_fuzzed PUBLIC Threads::Threads PRIVATE yaml-cpp ZLIB::ZLIB BZip2::BZip2)
set_target_properties(oriel_fuzzed PROPERTIES EXCLUDE_FROM_ALL ON)

add_custom_target(oriel_fuzzers)
file(GLOB fuzzers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/fuzz/*_fuzzer.cc)
foreach(source IN LISTS fuzzers)
  cmake_path(GET source STEM name)
  add_executable(oriel_${name} EXCLUDE_FROM_ALL ${source})
  set_target_properties(oriel_${name} PROPERTIES OUTPUT_NAME ${name}
                        RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/fuzzers)
  oriel_flags(oriel_${name})
  target_include_directories(oriel_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(oriel_${name} PRIVATE oriel_fuzzed)
  target_link_options(oriel_${name} PRIVATE -fsanitize=fuzzer)
  add_dependencies(oriel_fuzzers oriel_${name})
endforeach()
