# Compiler settings, and one function for each kind of target.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)

find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)

add_library(hapticd_flags INTERFACE)
target_compile_options(hapticd_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align
  $<$<BOOL:${HAPTICD_WERROR}>:-Werror>
  # The same input gives the same bytes on every x86-64-v2 machine: no contraction, no fast-math.
  -ffp-contract=off
  $<$<STREQUAL:${CMAKE_SYSTEM_PROCESSOR},x86_64>:-march=x86-64-v2>)
if(HAPTICD_SANITIZE)
  target_compile_options(hapticd_flags INTERFACE -fsanitize=${HAPTICD_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(hapticd_flags INTERFACE -fsanitize=${HAPTICD_SANITIZE})
  target_compile_definitions(hapticd_flags INTERFACE HAPTICD_SANITIZED=1)
  # With a sanitizer's code in between, GCC 12 sees unset variables where there are none, in <regex> for one; the release
  # build warns of the real ones.
  target_compile_options(hapticd_flags INTERFACE -Wno-maybe-uninitialized)
  if(HAPTICD_SANITIZE MATCHES "thread" AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # It warns of every fence, which it does not model; the fences here order what reference counts guard.
    target_compile_options(hapticd_flags INTERFACE -Wno-tsan)
  endif()
endif()

# hapticd_library(NAME SOURCES ... DEPENDS rooms ... [LIBS external ...] [PRIVATE_LIBS external ...])
# One library per folder of src/. DEPENDS is the list of rooms it may include: scripts/check_includes.sh
# reads it from here, so the arrow and the link line cannot differ.
function(hapticd_library name)
  cmake_parse_arguments(A "" "" "SOURCES;DEPENDS;LIBS;PRIVATE_LIBS" ${ARGN})
  set(deps ${A_DEPENDS})
  list(TRANSFORM deps PREPEND hapticd_)
  if(A_SOURCES)
    add_library(hapticd_${name} STATIC ${A_SOURCES})
    target_include_directories(hapticd_${name} PUBLIC ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)
    target_link_libraries(hapticd_${name} PUBLIC ${deps} ${A_LIBS} PRIVATE hapticd_flags ${A_PRIVATE_LIBS})
    set_target_properties(hapticd_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  else()
    add_library(hapticd_${name} INTERFACE)
    target_include_directories(hapticd_${name} INTERFACE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)
    target_link_libraries(hapticd_${name} INTERFACE ${deps} ${A_LIBS})
  endif()
endfunction()

# What the sanitizer runs of scripts/test.sh build: no more than they need.
add_custom_target(all_tests)
add_custom_target(threads_tests)

# For sources of tests, after the flags of all. The libraries are watched for everything; in what a test itself says
# three of UBSan's checks take half of the time to compile.
add_library(hapticd_test_flags INTERFACE)
if(HAPTICD_SANITIZE MATCHES "undefined")
  target_compile_options(hapticd_test_flags INTERFACE -fno-sanitize=null,alignment,vptr)
endif()

# hapticd_test(NAME SOURCES ... DEPENDS rooms ... [LIBS ...] [LABELS ...])
# One test program NAME_test; every TEST() in it becomes one ctest case.
function(hapticd_test name)
  cmake_parse_arguments(A "" "" "SOURCES;DEPENDS;LIBS;LABELS" ${ARGN})
  set(deps ${A_DEPENDS})
  list(TRANSFORM deps PREPEND hapticd_)
  add_executable(${name}_test ${A_SOURCES})
  target_include_directories(${name}_test PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${name}_test PRIVATE ${deps} ${A_LIBS} hapticd_flags hapticd_test_flags GTest::gtest_main GTest::gmock)
  # Tests are compiled once and run once: what the optimiser would win is less than what it costs.
  target_compile_options(${name}_test PRIVATE $<$<CONFIG:Release>:-O1>)
  target_compile_definitions(${name}_test PRIVATE HAPTICD_TESTDATA="${PROJECT_SOURCE_DIR}/testdata")
  add_dependencies(all_tests ${name}_test)
  set(properties TIMEOUT 300)
  if("threads" IN_LIST A_LABELS)
    add_dependencies(threads_tests ${name}_test)
  endif()
  if(A_LABELS)
    list(APPEND properties LABELS "${A_LABELS}")
  endif()
  gtest_discover_tests(${name}_test TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60 PROPERTIES ${properties})
endfunction()
