# What `cmake --install` installs, and what find_package(hapticd) and pkg-config find there.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# hapticd::client: the client and the rooms below it in one archive. It needs the standard library and threads only.
add_library(hapticd_client_archive STATIC
  $<TARGET_OBJECTS:hapticd_client> $<TARGET_OBJECTS:hapticd_base> $<TARGET_OBJECTS:hapticd_net> $<TARGET_OBJECTS:hapticd_wire>)
set_target_properties(hapticd_client_archive PROPERTIES
  EXPORT_NAME client OUTPUT_NAME hapticd_client LINKER_LANGUAGE CXX ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib)
target_link_libraries(hapticd_client_archive PUBLIC Threads::Threads)

foreach(library hapticd_client_archive hapticd_client_shared)
  target_include_directories(${library} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${library} INTERFACE cxx_std_20)
endforeach()
target_include_directories(hapticd_vrpn INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/hapticd/vrpn>)
target_compile_features(hapticd_vrpn INTERFACE cxx_std_11)

install(TARGETS hapticd_client_archive hapticd_client_shared hapticd_vrpn EXPORT hapticd)
install(DIRECTORY include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")

set(HAPTICD_CONFIG_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/hapticd)
install(EXPORT hapticd NAMESPACE hapticd:: FILE hapticdTargets.cmake DESTINATION ${HAPTICD_CONFIG_DIR})
configure_package_config_file(cmake/hapticdConfig.cmake.in hapticdConfig.cmake INSTALL_DESTINATION ${HAPTICD_CONFIG_DIR})
write_basic_package_version_file(hapticdConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/hapticdConfig.cmake ${PROJECT_BINARY_DIR}/hapticdConfigVersion.cmake
        DESTINATION ${HAPTICD_CONFIG_DIR})

# From the file's folder up to the prefix, so that the installed tree may be moved.
file(RELATIVE_PATH HAPTICD_PC_TO_PREFIX /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
foreach(package hapticd hapticd-vrpn)
  configure_file(cmake/${package}.pc.in ${package}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${package}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endforeach()

install(FILES packaging/grafana/hapticd.json DESTINATION ${CMAKE_INSTALL_DATADIR}/hapticd/grafana)
