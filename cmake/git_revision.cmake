# Script (cmake -P): writes OUTPUT from TEMPLATE with the git revision of SOURCE. Without git or outside a checkout it is what a file
# REVISION in SOURCE says, or "unknown".
# Runs at every build, so that the revision in a result is that of the program that made it; an unchanged file is not touched.
set(AMBILUX_REVISION "unknown")
if(EXISTS ${SOURCE}/REVISION)
  file(STRINGS ${SOURCE}/REVISION AMBILUX_REVISION LIMIT_COUNT 1)
endif()
find_program(GIT_PROGRAM git)
if(GIT_PROGRAM)
  # Only this project's own repository counts: a source archive unpacked inside some other checkout has no revision.
  execute_process(COMMAND ${GIT_PROGRAM} -C ${SOURCE} rev-parse --show-toplevel
    OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  file(REAL_PATH "${SOURCE}" source_path)
  if(NOT failed AND top STREQUAL source_path)
    execute_process(COMMAND ${GIT_PROGRAM} -C ${SOURCE} describe --always --dirty --abbrev=12 --exclude=*
      OUTPUT_VARIABLE revision OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
    if(NOT failed AND revision)
      set(AMBILUX_REVISION "${revision}")
    endif()
  endif()
endif()
configure_file(${TEMPLATE} ${OUTPUT} @ONLY)
