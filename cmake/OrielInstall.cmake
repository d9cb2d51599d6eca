# install and find_package(oriel [COMPONENTS io]): targets oriel::oriel and oriel::io. Data never go into a package.

include(CMakePackageConfigHelpers)
set(oriel_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/oriel)

install(TARGETS oriel_core EXPORT oriel-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT oriel-targets NAMESPACE oriel:: DESTINATION ${oriel_package_dir})
set(installed_rooms base manifold sensor residual graph linear solve window run)
if(TARGET oriel_io)
  install(TARGETS oriel_io EXPORT oriel-io-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT oriel-io-targets NAMESPACE oriel:: DESTINATION ${oriel_package_dir})
  list(APPEND installed_rooms io evaluate)
endif()
foreach(room IN LISTS installed_rooms)
  if(IS_DIRECTORY ${oriel_source_root}/oriel/${room})
    install(DIRECTORY ${oriel_source_root}/oriel/${room} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/oriel
            FILES_MATCHING PATTERN "*.h")
  endif()
endforeach()
if(TARGET oriel_cli)
  install(TARGETS oriel_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT command)
endif()
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/oriel-config.cmake.in ${PROJECT_BINARY_DIR}/oriel-config.cmake
                              INSTALL_DESTINATION ${oriel_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/oriel-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/oriel-config.cmake ${PROJECT_BINARY_DIR}/oriel-config-version.cmake
        DESTINATION ${oriel_package_dir})
