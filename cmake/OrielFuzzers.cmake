# fuzz/*_fuzzer.cc: one libFuzzer program each, build/fuzz/fuzzers/<name>. Only Clang has libFuzzer; the preset `fuzz`
# compiles everything for it. `./test --fuzz [SECONDS]` builds and runs them.
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  message(FATAL_ERROR "ORIEL_FUZZERS: expected Clang, found ${CMAKE_CXX_COMPILER_ID}; use the preset fuzz")
endif()
file(GLOB fuzzers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/fuzz/*_fuzzer.cc)
foreach(source IN LISTS fuzzers)
  cmake_path(GET source STEM name)
  add_executable(oriel_${name} ${source})
  set_target_properties(oriel_${name} PROPERTIES OUTPUT_NAME ${name}
                        RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/fuzzers)
  oriel_flags(oriel_${name})
  oriel_links(oriel_${name} oriel_io oriel_core)
  target_include_directories(oriel_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_options(oriel_${name} PRIVATE -fsanitize=fuzzer)
endforeach()
