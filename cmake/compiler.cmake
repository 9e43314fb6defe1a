# One interface target that carries include paths and flags for all of the project.
add_library(ambilux_options INTERFACE)
target_include_directories(ambilux_options INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
# Compilers contract a*b+c differently in every copy of an inlined function; without that, images do not depend on which stages are inlined where.
target_compile_options(ambilux_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wshadow -fno-math-errno -ffp-contract=off>)
# GCC's garbage collector starts at 128 MB of heap otherwise, which most sources exceed, and takes up to a tenth of their time.
target_compile_options(ambilux_options INTERFACE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:--param=ggc-min-heapsize=1048576>)
# Tests of rays join conditions without branches on purpose.
target_compile_options(ambilux_options INTERFACE $<$<COMPILE_LANG_AND_ID:CXX,Clang>:-Wno-bitwise-instead-of-logical>)
if(AMBILUX_MARCH)
  target_compile_options(ambilux_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-march=${AMBILUX_MARCH}>)
endif()
if(AMBILUX_SANITIZE)
  target_compile_options(ambilux_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${AMBILUX_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all>)
  target_link_options(ambilux_options INTERFACE -fsanitize=${AMBILUX_SANITIZE})
endif()
# Each test is a program, and GNU ld takes three to six times as long for one.
include(CheckLinkerFlag)
foreach(linker lld gold)
  check_linker_flag(CXX -fuse-ld=${linker} AMBILUX_HAS_${linker})
  if(AMBILUX_HAS_${linker})
    target_link_options(ambilux_options INTERFACE $<BUILD_INTERFACE:-fuse-ld=${linker}>)
    break()
  endif()
endforeach()
if(AMBILUX_HAS_CUDA)
  # Device code calls constexpr host functions; line info costs nothing at run time and serves the profiler. Quotients and roots without the branch for rare
  # operands make shading a tenth faster (docs/performance.md); what must be correctly rounded says so (core/math.h, rounded_divide).
  target_compile_options(ambilux_options INTERFACE
    $<$<COMPILE_LANGUAGE:CUDA>:--expt-relaxed-constexpr -prec-div=false -prec-sqrt=false>
    $<$<COMPILE_LANGUAGE:CUDA>:$<IF:$<BOOL:${AMBILUX_CUDA_SMALL}>,--compress-mode=size,-lineinfo>>)
  if(NOT AMBILUX_CUDA_OPTIMISE)
    string(REPLACE "-O3" "-O0" CMAKE_CUDA_FLAGS_RELEASE "${CMAKE_CUDA_FLAGS_RELEASE}")  # of the host's part
    if(CMAKE_CUDA_COMPILER_VERSION VERSION_GREATER_EQUAL 12.9)
      target_compile_options(ambilux_options INTERFACE $<$<COMPILE_LANGUAGE:CUDA>:--Ofast-compile=max>)
    else()
      target_compile_options(ambilux_options INTERFACE "$<$<COMPILE_LANGUAGE:CUDA>:SHELL:-Xptxas -O0>")
    endif()
  endif()
endif()
if(NOT AMBILUX_CPU_OPTIMISE)
  string(REPLACE "-O3" "-O1" CMAKE_CXX_FLAGS_RELEASE "${CMAKE_CXX_FLAGS_RELEASE}")
endif()
find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # What it asks for before it takes precompiled headers: no source looks at the time, and macros of theirs are those of the command line.
  set(CMAKE_CXX_COMPILER_LAUNCHER env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
  set(CMAKE_CUDA_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()
