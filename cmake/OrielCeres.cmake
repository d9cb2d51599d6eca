# engines/ceres: the oracle and rival. Nothing of the core depends on it.

file(GLOB ceres_sources CONFIGURE_DEPENDS ${oriel_source_root}/oriel/engines/ceres/*.cc
     ${oriel_source_root}/oriel/engines/ceres/*.h)
if(NOT ORIEL_CERES OR NOT ceres_sources)
  return()
endif()
find_package(Ceres QUIET)
if(NOT Ceres_FOUND)
  message(STATUS "oriel: no Ceres, so no engines/ceres and no benchmark against it")
  return()
endif()

oriel_library(oriel_ceres SOURCES ${ceres_sources})
# Debian's SuiteSparse takes whichever BLAS is loaded first, and ATLAS is 1.6 times slower than OpenBLAS: a comparison
# must not win by that. --no-as-needed, because none of our own objects names a symbol of OpenBLAS; and all in one word,
# because CMake would move a library of its own to the end, where Ceres lists it too.
find_library(ORIEL_OPENBLAS openblas)
if(ORIEL_OPENBLAS)
  target_link_libraries(oriel_ceres INTERFACE -Wl,--push-state,--no-as-needed,${ORIEL_OPENBLAS},--pop-state)
else()
  message(STATUS "oriel: no OpenBLAS, so Ceres is slower than it could be: do not trust the comparison")
endif()
target_link_libraries(oriel_ceres PUBLIC oriel_core Ceres::ceres)
