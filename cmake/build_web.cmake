# cmake -DWEB=source -DOUT=folder -DNPM=npm -P build_web.cmake: the bundle of WEB into OUT/dist, then OUT/bundle.stamp.
# npm works in a copy below OUT, so that nothing is written into the sources. A failure warns and leaves no bundle: a
# registry that is out of reach should keep nobody from a server.
set(copy ${OUT}/source)
file(REMOVE_RECURSE ${OUT}/dist ${copy}/src ${copy}/static)
file(REMOVE ${OUT}/bundle.stamp)
file(COPY ${WEB}/ DESTINATION ${copy} PATTERN node_modules EXCLUDE PATTERN dist EXCLUDE)

# "Load the bunny" of the empty page.
file(COPY ${WEB}/../testdata/meshes/bunny.obj DESTINATION ${copy}/static)

function(run_npm result)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env HAPTICD_WEB_OUT=${OUT}/dist ${NPM} ${ARGN} WORKING_DIRECTORY ${copy}
    RESULT_VARIABLE status OUTPUT_VARIABLE said ERROR_VARIABLE said)
  set(${result} ${status} PARENT_SCOPE)
  if(NOT status EQUAL 0)
    string(REPLACE ";" " " arguments "${ARGN}")
    message(WARNING "The viewer is not built: 'npm ${arguments}' failed. Build again when that is mended, or configure with "
      "-DHAPTICD_WEB=OFF.\n${said}")
  endif()
endfunction()

set(status 0)
file(SHA256 ${WEB}/package-lock.json wanted)
set(installed "")
if(EXISTS ${OUT}/npm.stamp AND EXISTS ${copy}/node_modules)
  file(READ ${OUT}/npm.stamp installed)
endif()
if(NOT installed STREQUAL wanted)
  run_npm(status ci --ignore-scripts --no-audit --no-fund)
  if(status EQUAL 0)
    file(WRITE ${OUT}/npm.stamp ${wanted})
  endif()
endif()
if(status EQUAL 0)
  run_npm(status run build)
endif()
if(status EQUAL 0)
  file(WRITE ${OUT}/bundle.stamp "")
else()
  file(REMOVE_RECURSE ${OUT}/dist)
endif()
