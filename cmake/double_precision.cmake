# compile_in_double(TARGET NAMESPACE PREFIX HEADER...): copies of the project's headers in which every float is a
# double, for TARGET to include as PREFIX/HEADER. What was in namespace ambilux is in ambilux::NAMESPACE there. A copy
# includes copies; other headers of the project keep their floats and have to be named in kept_single below. Lines keep
# their numbers, and messages of compilers and debuggers name the originals.
#
# As a script it makes the copies: -DSOURCE= -DOUTPUT= -DNAMESPACE= -DPREFIX= -DHEADERS="a|b".

function(compile_in_double target namespace prefix)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/in_double)
  set(script ${PROJECT_SOURCE_DIR}/cmake/double_precision.cmake)
  list(TRANSFORM ARGN PREPEND ${PROJECT_SOURCE_DIR}/ OUTPUT_VARIABLE originals)
  list(TRANSFORM ARGN PREPEND ${output}/${prefix}/ OUTPUT_VARIABLE copies)
  list(JOIN ARGN "|" headers)
  add_custom_command(
    OUTPUT ${copies}
    COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DOUTPUT=${output} -DNAMESPACE=${namespace}
            -DPREFIX=${prefix} "-DHEADERS=${headers}" -P ${script}
    DEPENDS ${originals} ${script}
    COMMENT "Headers in double precision" VERBATIM)
  target_sources(${target} PRIVATE ${copies})
  target_include_directories(${target} PUBLIC ${output})
endfunction()

if(NOT CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  return()
endif()
cmake_minimum_required(VERSION 3.25)

# Macros, storage of 32 bits and what has no floats of its own, loops on all threads.
set(kept_single core/hd.h core/half.h core/float32.h core/lane.h core/parallel.h)
set(functions sqrt fabs fma copysign floor ceil exp expm1 log log1p erf sin cos asin acos atan2 __builtin_huge_val)
string(REPLACE "|" ";" HEADERS "${HEADERS}")
list(JOIN functions "|" functions)

# Of a word: the character before it, which is kept.
set(before "([^A-Za-z0-9_.])")
set(after "([^A-Za-z0-9_])")
set(exponent "[eE][-+]?[0-9]+")

foreach(header ${HEADERS})
  file(READ ${SOURCE}/${header} text)
  # Brackets and semicolons mean something to CMake in lists only; this is none.
  foreach(twice 1 2)  # matches share their borders
    string(REGEX REPLACE "${before}float${after}" "\\1double\\2" text "${text}")
    string(REGEX REPLACE "${before}(${functions})f\\(" "\\1\\2(" text "${text}")
  endforeach()
  string(REGEX REPLACE "${before}(0x[0-9a-fA-F.]+p[-+]?[0-9]+)f" "\\1\\2" text "${text}")
  string(REGEX REPLACE "${before}([0-9]+\\.[0-9]*(${exponent})?|[0-9]+${exponent})f" "\\1\\2" text "${text}")
  string(REGEX REPLACE "namespace ambilux" "namespace ambilux::${NAMESPACE}" text "${text}")
  string(REGEX MATCHALL "#include \"[^\"]+\"" includes "${text}")
  foreach(include ${includes})
    string(REGEX REPLACE "#include \"(.*)\"" "\\1" name "${include}")
    if(name IN_LIST HEADERS)
      string(REPLACE "\"${name}\"" "\"${PREFIX}/${name}\"" text "${text}")
    elseif(NOT name IN_LIST kept_single)
      message(FATAL_ERROR "${header}: includes ${name}, which is not compiled in double precision "
                          "(compile_in_double) and not named in cmake/double_precision.cmake as one that stays single")
    endif()
  endforeach()
  # A copy that stays as it is rebuilds nothing.
  file(CONFIGURE OUTPUT ${OUTPUT}/${PREFIX}/${header} CONTENT "#line 1 \"${SOURCE}/${header}\"\n${text}" @ONLY)
endforeach()
