# mpc_add_library, mpc_add_program, mpc_add_test, mpc_install_package: one list per target, one
# place for warnings, standards and install rules.
include(CMakePackageConfigHelpers)

set(MPC_WARNINGS -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor)

function(mpc_set_warnings target)
  target_compile_options(${target} PRIVATE ${MPC_WARNINGS} $<$<BOOL:${MPC_WERROR}>:-Werror>)
endfunction()

# mpc_add_library(NAME HEADERS <h...> SOURCES <cc...> PUBLIC_DEPS <t...> PRIVATE_DEPS <t...>)
# Static library mpc_NAME, alias mpc::NAME, own include root include/, headers installed and each
# compiled alone by the target all_verify_interface_header_sets.
function(mpc_add_library name)
  cmake_parse_arguments(ARG "" "OUTPUT_NAME" "HEADERS;SOURCES;PUBLIC_DEPS;PRIVATE_DEPS" ${ARGN})
  set(target mpc_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(mpc::${name} ALIAS ${target})
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS include FILES ${ARG_HEADERS})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC_DEPS} PRIVATE ${ARG_PRIVATE_DEPS})
  set_target_properties(${target} PROPERTIES
    POSITION_INDEPENDENT_CODE ON
    CXX_EXTENSIONS OFF
    EXPORT_NAME ${name}
    VERIFY_INTERFACE_HEADER_SETS ${PROJECT_IS_TOP_LEVEL})
  if(ARG_OUTPUT_NAME)
    set_target_properties(${target} PROPERTIES OUTPUT_NAME ${ARG_OUTPUT_NAME})
  endif()
  mpc_set_warnings(${target})
  install(TARGETS ${target} EXPORT mpcTargets FILE_SET HEADERS)
endfunction()

# mpc_add_program(NAME SOURCES <cc...> DEPS <t...>)
function(mpc_add_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPS})
  set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
  mpc_set_warnings(${name})
endfunction()

# mpc_add_test(NAME LABEL unit|slow|data|blender SOURCES <cc...> DEPS <t...>)
# The target LABEL_tests builds all tests of a label.
function(mpc_add_test name)
  cmake_parse_arguments(ARG "" "LABEL" "SOURCES;DEPS" ${ARGN})
  mpc_add_program(${name} SOURCES ${ARG_SOURCES} DEPS ${ARG_DEPS} mpc_test_main)
  gtest_discover_tests(${name} PROPERTIES LABELS ${ARG_LABEL} DISCOVERY_TIMEOUT 60)
  if(NOT TARGET ${ARG_LABEL}_tests)
    add_custom_target(${ARG_LABEL}_tests)
  endif()
  add_dependencies(${ARG_LABEL}_tests ${name})
endfunction()

function(mpc_install_package)
  set(destination ${CMAKE_INSTALL_LIBDIR}/cmake/mpc)
  install(EXPORT mpcTargets NAMESPACE mpc:: DESTINATION ${destination})
  configure_package_config_file(
    ${PROJECT_SOURCE_DIR}/cmake/mpcConfig.cmake.in ${PROJECT_BINARY_DIR}/mpcConfig.cmake
    INSTALL_DESTINATION ${destination})
  write_basic_package_version_file(
    ${PROJECT_BINARY_DIR}/mpcConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/mpcConfig.cmake ${PROJECT_BINARY_DIR}/mpcConfigVersion.cmake
    DESTINATION ${destination})
endfunction()
