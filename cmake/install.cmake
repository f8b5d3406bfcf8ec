# What `cmake --install` installs, and what find_package(hapticd) and pkg-config find there.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# hapticd::client: the client and the rooms below it in one archive. It needs the standard library and threads only.
add_library(hapticd_client_archive STATIC
  $<TARGET_OBJECTS:hapticd_client> $<TARGET_OBJECTS:hapticd_base> $<TARGET_OBJECTS:hapticd_net> $<TARGET_OBJECTS:hapticd_wire>)
set_target_properties(hapticd_client_archive PROPERTIES
  EXPORT_NAME client OUTPUT_NAME hapticd_client LINKER_LANGUAGE CXX ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
target_link_libraries(hapticd_client_archive PUBLIC Threads::Threads)

foreach(library hapticd_client_archive hapticd_client_shared)
  target_include_directories(${library} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${library} INTERFACE cxx_std_20)
endforeach()
target_include_directories(hapticd_vrpn INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/hapticd/vrpn>)
target_compile_features(hapticd_vrpn INTERFACE cxx_std_11)

if(NOT HAPTICD_INSTALL)
  return()
endif()
install(TARGETS hapticd hapticd-bench)
if(TARGET hapticd-ros2)
  install(TARGETS hapticd-ros2 OPTIONAL)
endif()
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
install(FILES testdata/meshes/bunny.obj DESTINATION ${CMAKE_INSTALL_DATADIR}/hapticd/meshes)
# What an operator copies into the system; the Debian package does it (scripts/package.sh).
install(FILES packaging/systemd/hapticd.service packaging/systemd/hapticd-loopback.service packaging/sysusers/hapticd.conf packaging/udev/70-hapticd.rules packaging/hapticd.toml
        DESTINATION ${CMAKE_INSTALL_DATADIR}/hapticd/system)
install(FILES packaging/polkit/50-hapticd.rules DESTINATION ${CMAKE_INSTALL_DATADIR}/hapticd/system RENAME polkit.rules)
install(FILES packaging/limits/hapticd.conf DESTINATION ${CMAKE_INSTALL_DATADIR}/hapticd/system RENAME limits.conf)
install(FILES packaging/desktop/hapticd.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
install(FILES packaging/desktop/io.hapticd.viewer.metainfo.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/metainfo)
install(FILES web/static/viewer.svg DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps RENAME hapticd.svg)
install(FILES LICENSE CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
# Man pages and completion, from the options of the program.
install(CODE "
  execute_process(COMMAND $<TARGET_FILE:hapticd> manual \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}\"
    COMMAND_ERROR_IS_FATAL ANY)
  ")

# Programs and shared libraries are installed without symbols. The symbols are in .debug/NAME.debug beside each file, where
# debuggers look; with HAPTICD_NO_DEBUG_FILES in the environment, the symbols are left out.
function(hapticd_split_symbols target directory)
  install(CODE "
    set(file \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${directory}/$<TARGET_FILE_NAME:${target}>\")
    if(NOT EXISTS \${file})
      # An optional program that was not built.
    elseif(DEFINED ENV{HAPTICD_NO_DEBUG_FILES})
      execute_process(COMMAND ${CMAKE_STRIP} \${file} COMMAND_ERROR_IS_FATAL ANY)
    else()
      cmake_path(GET file PARENT_PATH folder)
      cmake_path(GET file FILENAME name)
      file(MAKE_DIRECTORY \${folder}/.debug)
      execute_process(COMMAND ${CMAKE_OBJCOPY} --only-keep-debug \${file} \${folder}/.debug/\${name}.debug COMMAND_ERROR_IS_FATAL ANY)
      execute_process(COMMAND ${CMAKE_STRIP} \${file} COMMAND_ERROR_IS_FATAL ANY)
      execute_process(COMMAND ${CMAKE_OBJCOPY} --add-gnu-debuglink=.debug/\${name}.debug \${file}
        WORKING_DIRECTORY \${folder} COMMAND_ERROR_IS_FATAL ANY)
    endif()
    ")
endfunction()
hapticd_split_symbols(hapticd ${CMAKE_INSTALL_BINDIR})
hapticd_split_symbols(hapticd-bench ${CMAKE_INSTALL_BINDIR})
if(TARGET hapticd-ros2)
  hapticd_split_symbols(hapticd-ros2 ${CMAKE_INSTALL_BINDIR})
endif()
foreach(library hapticd_vrpn hapticd_client_shared)
  hapticd_split_symbols(${library} ${CMAKE_INSTALL_LIBDIR})
endforeach()
