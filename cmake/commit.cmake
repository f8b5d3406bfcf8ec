# cmake -DSOURCE=folder -DOUT=file.h -P commit.cmake: the commit of the sources as HAPTICD_COMMIT; "unknown" outside of git.
execute_process(COMMAND git describe --always --dirty --abbrev=12 --exclude=* WORKING_DIRECTORY ${SOURCE}
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE status)
if(NOT status EQUAL 0)
  set(commit unknown)
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT "#define HAPTICD_COMMIT \"${commit}\"\n")
