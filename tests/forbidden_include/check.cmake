# Compiles one header of every library with INCLUDE_DIRS: those of ALLOWED must compile, all others
# must fail because the file is not found.
cmake_minimum_required(VERSION 3.25)

list(TRANSFORM INCLUDE_DIRS PREPEND -I OUTPUT_VARIABLE flags)
file(GLOB folders ${SOURCE_DIR}/libmpc*/include/mpc)
foreach(folder ${folders})
  file(GLOB_RECURSE headers RELATIVE ${folder}/.. ${folder}/*.h)
  if(NOT headers)
    continue()
  endif()
  list(GET headers 0 header)
  string(REGEX REPLACE ".*/libmpc_?([a-z]*)/.*" "\\1" library ${folder})  # "" for the facade
  file(WRITE ${SCRATCH} "#include \"${header}\"\n")
  execute_process(COMMAND ${COMPILER} -std=c++20 -fsyntax-only ${flags} ${SCRATCH}
    RESULT_VARIABLE result ERROR_VARIABLE message)
  if(library IN_LIST ALLOWED)
    if(NOT result EQUAL 0)
      message(SEND_ERROR "${header} must compile here, but: ${message}")
    endif()
  elseif(result EQUAL 0)
    message(SEND_ERROR "${header} must not be reachable here, but it compiles")
  elseif(NOT message MATCHES "${header}: No such file")
    message(SEND_ERROR "${header} must fail as not found, but: ${message}")
  endif()
endforeach()
