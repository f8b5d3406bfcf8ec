# Compiler settings, and one function for each kind of target.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
if(PROJECT_IS_TOP_LEVEL)
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
endif()

find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
include(CheckLinkerFlag)
check_linker_flag(CXX -fuse-ld=lld HAPTICD_LLD)  # links the larger programs in a fraction of the time

add_library(hapticd_flags INTERFACE)
target_compile_options(hapticd_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align
  $<$<BOOL:${HAPTICD_WERROR}>:-Werror>
  # In GCC's library std::stable_sort calls a deprecated function, and clang says so.
  $<$<CXX_COMPILER_ID:Clang>:-Wno-deprecated-declarations>
  # GCC 12 reports copies beyond arrays inside of its own library where there are none, for example in "a" + std::string().
  "$<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-restrict;-Wno-stringop-overflow>"
  # GCC collects garbage from 128 MB on. Up to 500 MB it does not: 8 % less time to compile, 10 % more memory.
  "$<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=500000>"
  # No contraction and no fast-math, so that the same input gives the same bytes on every x86-64-v2 machine.
  -ffp-contract=off
  $<$<STREQUAL:${CMAKE_SYSTEM_PROCESSOR},x86_64>:-march=x86-64-v2>)
if(HAPTICD_LLD)
  target_link_options(hapticd_flags INTERFACE -fuse-ld=lld)
endif()
if(HAPTICD_SANITIZE)
  target_compile_options(hapticd_flags INTERFACE -fsanitize=${HAPTICD_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(hapticd_flags INTERFACE -fsanitize=${HAPTICD_SANITIZE})
  target_compile_definitions(hapticd_flags INTERFACE HAPTICD_SANITIZED=1)
  if(HAPTICD_SANITIZE MATCHES "undefined" AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    # Vendors' C functions return structs that the drivers know by names of their own. ASan knows the size of every object.
    target_compile_options(hapticd_flags INTERFACE -fno-sanitize=function,object-size)
  endif()
  # With the code of a sanitizer in between, GCC 12 reports uninitialized variables where there are none, for example in
  # <regex>; the release build reports the real ones.
  target_compile_options(hapticd_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  if(HAPTICD_SANITIZE MATCHES "thread" AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # GCC warns about every fence, because TSan does not model them; the fences here order what reference counts guard.
    target_compile_options(hapticd_flags INTERFACE -Wno-tsan)
  endif()
endif()

# Rooms that compute so much that they, and their tests, are optimised in every build. Under TSan unoptimised mocks are too
# slow for the deadlines of devices.
set(HAPTICD_COMPUTING_ROOMS "/(geometry|scene|realtime|truth|simulated|sim)(/|$)")
if(HAPTICD_SANITIZE MATCHES "thread")
  string(PREPEND HAPTICD_COMPUTING_ROOMS "/tests/device/|")
endif()

# For the rooms that a tick runs through. A tenth fewer instructions, and 5 % of its time. Nobody replaces our functions or
# reads errno after our roots. GCC inlines less in large sources: without the last option, rooms that are one source each are
# 5 % slower.
set(HAPTICD_TICK_OPTIONS $<$<CONFIG:Release>:-O3> -fno-semantic-interposition -fno-math-errno
  $<$<CXX_COMPILER_ID:GNU>:--param=inline-unit-growth=300>)

# Asio and Beast. They are compiled into each source that includes them, so all sources must see the same options.
find_package(Boost 1.74 REQUIRED)
add_library(hapticd_asio INTERFACE)
target_link_libraries(hapticd_asio INTERFACE Boost::headers)
target_compile_definitions(hapticd_asio INTERFACE BOOST_ASIO_NO_DEPRECATED)
if(HAPTICD_SANITIZE MATCHES "thread")
  # ThreadSanitizer does not know fences; Asio's locks, which it knows, order the same accesses.
  target_compile_definitions(hapticd_asio INTERFACE BOOST_ASIO_DISABLE_FENCED_BLOCK)
endif()

# hapticd_precompile(TARGET HEADERS): TARGET includes the precompiled headers of HEADERS, if HAPTICD_PCH has them made.
function(hapticd_precompile target headers)
  if(TARGET ${headers})
    target_precompile_headers(${target} REUSE_FROM ${headers})
  endif()
endfunction()

# hapticd_unite(TARGET COUNT): compiles the sources of TARGET in files of COUNT, unless HAPTICD_UNITY is OFF. For programs,
# whose sources share few headers of their own but many large ones of others.
function(hapticd_unite target count)
  if(HAPTICD_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${count})
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

# hapticd_speed_up(TARGET HEADERS KIND): the same; where HAPTICD_UNITY is KIND or ALL, all sources of TARGET are one file.
function(hapticd_speed_up target headers kind)
  if(HAPTICD_UNITY STREQUAL kind OR HAPTICD_UNITY STREQUAL ALL)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
    # GCC takes the sources for headers, and warns of their anonymous namespaces.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
  hapticd_precompile(${target} ${headers})
endfunction()

# hapticd_headers(NAME KIND [PIC] LIBS external ... [OPTIONS ...] HEADERS ...): precompiles HEADERS for the functions above
# where HAPTICD_PCH is KIND or ALL. The compiler accepts them only in targets with the same options.
function(hapticd_headers name kind)
  cmake_parse_arguments(A "PIC" "" "LIBS;OPTIONS;HEADERS" ${ARGN})
  if(NOT (HAPTICD_PCH STREQUAL kind OR HAPTICD_PCH STREQUAL ALL))
    return()
  endif()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// CMake precompiles headers for targets with sources only.\n")
  add_library(${name} OBJECT ${source})
  target_link_libraries(${name} PRIVATE hapticd_flags ${A_LIBS})
  target_compile_options(${name} PRIVATE ${A_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${A_HEADERS})
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ${A_PIC})
endfunction()

set(HAPTICD_STD_HEADERS <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <cstring> <deque> <functional> <map> <memory>
  <mutex> <optional> <span> <sstream> <stdexcept> <string> <string_view> <thread> <tuple> <unordered_map> <utility> <variant>
  <vector>)
hapticd_headers(hapticd_room_headers ROOMS PIC
  LIBS Eigen3::Eigen HEADERS ${HAPTICD_STD_HEADERS} <Eigen/Core> <Eigen/Geometry>)
hapticd_headers(hapticd_tick_headers ROOMS PIC
  LIBS Eigen3::Eigen OPTIONS ${HAPTICD_TICK_OPTIONS} HEADERS ${HAPTICD_STD_HEADERS} <Eigen/Core> <Eigen/Geometry>)

# hapticd_library(NAME [TICK] SOURCES ... DEPENDS rooms ... [LIBS external ...] [PRIVATE_LIBS external ...])
# One library for each folder of src/. DEPENDS lists the rooms that it may include; scripts/check_includes.sh reads it.
# TICK: nearly every tick runs through the room.
function(hapticd_library name)
  cmake_parse_arguments(A "TICK" "" "SOURCES;DEPENDS;LIBS;PRIVATE_LIBS" ${ARGN})
  set(deps ${A_DEPENDS})
  list(TRANSFORM deps PREPEND hapticd_)
  if(A_SOURCES)
    add_library(hapticd_${name} STATIC ${A_SOURCES})
    target_include_directories(hapticd_${name} PUBLIC ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)
    target_link_libraries(hapticd_${name} PUBLIC ${deps} ${A_LIBS} PRIVATE hapticd_flags ${A_PRIVATE_LIBS})
    set_target_properties(hapticd_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    if(A_TICK)
      target_compile_options(hapticd_${name} PRIVATE ${HAPTICD_TICK_OPTIONS})
      hapticd_speed_up(hapticd_${name} hapticd_tick_headers ALL)
    else()
      hapticd_speed_up(hapticd_${name} hapticd_room_headers ALL)
    endif()
  else()
    add_library(hapticd_${name} INTERFACE)
    target_include_directories(hapticd_${name} INTERFACE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)
    target_link_libraries(hapticd_${name} INTERFACE ${deps} ${A_LIBS})
  endif()
endfunction()

# The targets of scripts/test.sh in the asan and the tsan preset.
add_custom_target(all_tests)
add_custom_target(threads_tests)

# Further flags for sources of tests. Three of UBSan's checks take half of their compile time; the libraries keep all checks.
add_library(hapticd_test_flags INTERFACE)
# The garbage collector of GCC (see above) takes a tenth of the time to compile tests.
target_compile_options(hapticd_test_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=2000000>)
if(HAPTICD_SANITIZE MATCHES "undefined")
  target_compile_options(hapticd_test_flags INTERFACE -fno-sanitize=null,alignment,vptr)
endif()

# Each test runs once: optimising it takes longer than it saves, but for tests that compute, and a third of the compile time.
set(HAPTICD_TEST_OPTIONS -O0)
set(HAPTICD_COMPUTING_TEST_OPTIONS $<$<CONFIG:Release>:-O1>)
if(HAPTICD_SANITIZE MATCHES "address" AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # The checks of ASan as calls: a fifth less to compile.
  list(APPEND HAPTICD_TEST_OPTIONS "SHELL:-mllvm -asan-instrumentation-with-call-threshold=0")
endif()

# hapticd_test_support(NAME SOURCES ... [DEPENDS rooms ...] [LIBS ...]): sources that several test programs share, compiled
# once; the programs name it in SUPPORT.
function(hapticd_test_support name)
  cmake_parse_arguments(A "" "" "SOURCES;DEPENDS;LIBS" ${ARGN})
  set(deps ${A_DEPENDS})
  list(TRANSFORM deps PREPEND hapticd_)
  add_library(${name} OBJECT ${A_SOURCES})
  hapticd_compile_as_test(${name})
  target_link_libraries(${name} PUBLIC ${deps} ${A_LIBS})
endfunction()

# What support and programs have in common.
function(hapticd_compile_as_test target)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${target} PRIVATE hapticd_flags hapticd_test_flags)
  if(TARGET hapticd_test_headers)
    target_link_libraries(${target} PRIVATE Eigen3::Eigen GTest::gtest GTest::gmock)  # what the precompiled headers include
  endif()
  target_compile_definitions(${target} PRIVATE HAPTICD_TESTDATA="${PROJECT_SOURCE_DIR}/testdata")
  if(CMAKE_CURRENT_SOURCE_DIR MATCHES "${HAPTICD_COMPUTING_ROOMS}")
    target_compile_options(${target} PRIVATE ${HAPTICD_COMPUTING_TEST_OPTIONS})
    hapticd_speed_up(${target} hapticd_computing_test_headers TESTS)
  else()
    target_compile_options(${target} PRIVATE ${HAPTICD_TEST_OPTIONS})
    hapticd_speed_up(${target} hapticd_test_headers TESTS)
  endif()
endfunction()

# hapticd_test(NAME SOURCES ... DEPENDS rooms ... [SUPPORT ...] [LIBS ...] [LABELS ...] [PROCESSORS n])
# One test program NAME_test; every TEST() in it becomes one ctest case, which takes the place of n others.
function(hapticd_test name)
  cmake_parse_arguments(A "" "PROCESSORS" "SOURCES;DEPENDS;SUPPORT;LIBS;LABELS" ${ARGN})
  # Under TSan, a server with its clients takes a whole processor. Of more servers than processors, each falls behind its
  # clock for good: four tests took 280 s instead of 4.
  if(HAPTICD_SANITIZE MATCHES "thread" AND "server" IN_LIST A_DEPENDS)
    set(A_PROCESSORS 2)
  endif()
  set(deps ${A_DEPENDS})
  list(TRANSFORM deps PREPEND hapticd_)
  add_executable(${name}_test ${A_SOURCES})
  hapticd_compile_as_test(${name}_test)
  target_link_libraries(${name}_test PRIVATE ${A_SUPPORT} ${deps} ${A_LIBS} GTest::gtest_main GTest::gmock)
  add_dependencies(all_tests ${name}_test)
  set(properties TIMEOUT 300)
  if("threads" IN_LIST A_LABELS)
    add_dependencies(threads_tests ${name}_test)
  endif()
  # These can run at any time: nothing in them waits for a time.
  if(CMAKE_CURRENT_SOURCE_DIR MATCHES "/tests/(geometry|scene|realtime|truth)(/|$)" AND NOT "threads" IN_LIST A_LABELS)
    list(APPEND A_LABELS computing)
  endif()
  if(A_LABELS)
    list(APPEND properties LABELS "${A_LABELS}")
  endif()
  if(A_PROCESSORS)
    list(APPEND properties PROCESSORS ${A_PROCESSORS})
  endif()
  gtest_discover_tests(${name}_test TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60 PROPERTIES ${properties})
endfunction()
