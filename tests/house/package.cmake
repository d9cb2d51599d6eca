# Installs into a folder of the build, then configures, builds and runs the consumer project against it alone.
# cmake -D BUILD_DIR=... -D CONSUMER_DIR=... -D GENERATOR=... -D COMPILER=... -P package.cmake

set(prefix ${BUILD_DIR}/consumer/prefix)
set(build ${BUILD_DIR}/consumer/build)
file(REMOVE_RECURSE ${prefix})

execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${prefix} OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)

file(GLOB_RECURSE exported ${prefix}/*.cmake)
if(NOT exported)
  message(FATAL_ERROR "no package files were installed under ${prefix}")
endif()
foreach(file IN LISTS exported)
  file(READ ${file} text)
  foreach(forbidden "-march" "-ffast-math" "-Werror" "Eigen")
    if(text MATCHES "${forbidden}")
      message(FATAL_ERROR "${file}: '${forbidden}' reaches whoever links oriel")
    endif()
  endforeach()
endforeach()
file(GLOB_RECURSE packaged RELATIVE ${prefix} ${prefix}/*.g2o ${prefix}/*.csv ${prefix}/*.tum ${prefix}/*-pre.txt)
if(packaged)
  message(FATAL_ERROR "data sets must stay out of the package: ${packaged}")
endif()

execute_process(COMMAND ${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${build} -G ${GENERATOR} -D CMAKE_BUILD_TYPE=Release
                        -D CMAKE_CXX_COMPILER=${COMPILER} -D CMAKE_PREFIX_PATH=${prefix}
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${build} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${build}/consumer COMMAND_ERROR_IS_FATAL ANY)
