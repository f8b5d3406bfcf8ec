# The viewer: built from web/ by npm and made part of the server.
option(HAPTICD_WEB "Build the viewer in web/ and make it part of the server (needs Node.js and npm)" ON)

# hapticd_embed_web(TARGET): adds the source file that holds the bundle to a target. Without HAPTICD_WEB, node or npm, or
# when npm fails, the bundle is empty and the server shows how to build it.
function(hapticd_embed_web target)
  set(web ${PROJECT_SOURCE_DIR}/web)
  set(out ${PROJECT_BINARY_DIR}/web)
  set(bundle "")
  set(dist ${out}/none)
  find_program(NODE_EXECUTABLE node)
  find_program(NPM_EXECUTABLE npm)
  if(HAPTICD_WEB AND EXISTS ${web}/package.json AND NOT (NODE_EXECUTABLE AND NPM_EXECUTABLE))
    message(WARNING "The viewer is not built: node or npm is missing. Install Node.js 18 or later with npm, or configure "
      "with -DHAPTICD_WEB=OFF.")
  elseif(HAPTICD_WEB AND EXISTS ${web}/package.json)
    file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${web}/src/* ${web}/static/*)
    file(GLOB files CONFIGURE_DEPENDS ${web}/*.json ${web}/*.mjs)
    set(bundle ${out}/bundle.stamp)
    set(dist ${out}/dist)
    add_custom_command(OUTPUT ${bundle}
      COMMAND ${CMAKE_COMMAND} -DWEB=${web} -DOUT=${out} -DNPM=${NPM_EXECUTABLE} -P ${PROJECT_SOURCE_DIR}/cmake/build_web.cmake
      DEPENDS ${sources} ${files} ${PROJECT_SOURCE_DIR}/cmake/build_web.cmake
      COMMENT "Building the viewer"
      VERBATIM)
  endif()
  add_custom_command(OUTPUT ${out}/web_bundle.cpp
    COMMAND ${CMAKE_COMMAND} -DDIST=${dist} -DOUT=${out}/web_bundle.cpp -P ${PROJECT_SOURCE_DIR}/cmake/embed_web.cmake
    DEPENDS ${bundle} ${PROJECT_SOURCE_DIR}/cmake/embed_web.cmake
    VERBATIM)
  target_sources(${target} PRIVATE ${out}/web_bundle.cpp)
endfunction()
