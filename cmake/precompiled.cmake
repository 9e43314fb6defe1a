# Headers of the standard library and of others that most sources read, compiled once for each set of flags. The project's own are not among them: a change of
# one would rebuild everything. Nor is json: GCC instantiates what a precompiled header uses of its templates again in every source, which takes 0.65 s of
# each, and reading the header where it is used 0.4 s more than that. Sources include what they use all the same, since CUDA sources and whoever uses the installed headers have no precompiled ones;
# -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON builds without.
set(AMBILUX_COMMON_HEADERS <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <cstring> <filesystem> <functional> <limits> <map> <memory> <mutex> <numeric>
  <optional> <set> <string> <string_view> <utility> <vector>)

# precompile(TARGET HEADER...) or precompile(TARGET REUSE_FROM OTHER), whose flags must be the same.
function(precompile target)
  if("${ARGV1}" STREQUAL REUSE_FROM)
    target_precompile_headers(${target} ${ARGN})
  else()
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
  if(CCACHE_PROGRAM AND CMAKE_CXX_COMPILER_ID STREQUAL GNU AND NOT CMAKE_DISABLE_PRECOMPILE_HEADERS)
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fpch-preprocess>)  # or ccache does not see them
  endif()
endfunction()

# Of all libraries: their definitions are those of every target that takes them.
file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/precompiled.cpp CONTENT "")
foreach(name precompiled precompiled_O1)
  add_library(ambilux_${name} OBJECT EXCLUDE_FROM_ALL ${CMAKE_CURRENT_BINARY_DIR}/precompiled.cpp)
  target_link_libraries(ambilux_${name} PRIVATE ambilux_options fmt::fmt spdlog::spdlog nlohmann_json::nlohmann_json TBB::tbb Threads::Threads)
  precompile(ambilux_${name} ${AMBILUX_COMMON_HEADERS} <fmt/format.h>)
endforeach()
target_compile_options(ambilux_precompiled_O1 PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-O1>)

# compile_with_O1(TARGET), in a Release build: for what looks at one setting, file or object of a scene at a time. What takes time is below it, and it compiles
# in two thirds of the time.
function(compile_with_O1 target)
  if(CMAKE_BUILD_TYPE STREQUAL Release)
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-O1>)
    precompile(${target} REUSE_FROM ambilux_precompiled_O1)
  else()
    precompile(${target} REUSE_FROM ambilux_precompiled)
  endif()
endfunction()

# compile_together(TARGET): six sources at a time. What json and CLI11 make of a source that uses them takes longer than the source itself.
function(compile_together target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
endfunction()
