# Checks of the project as a whole, run by scripts/test.sh (MPC_PROJECT_TESTS=ON): the header sets,
# the package as others use it, the format, the documentation, the sanitizers.
set(prefix ${PROJECT_BINARY_DIR}/prefix)
cmake_host_system_information(RESULT cores QUERY NUMBER_OF_LOGICAL_CORES)

# mpc_add_project_test(NAME <command...>): alone on the machine, because it builds or measures.
function(mpc_add_project_test name)
  add_test(NAME ${name} COMMAND ${ARGN} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(${name} PROPERTIES LABELS project RUN_SERIAL ON)
endfunction()

mpc_add_project_test(project.format ${PROJECT_SOURCE_DIR}/scripts/format.sh --check)
mpc_add_project_test(project.docs
  ${PROJECT_SOURCE_DIR}/scripts/check_docs.sh ${PROJECT_BINARY_DIR})
mpc_add_project_test(project.headers_compile_alone
  ${CMAKE_COMMAND} --build ${PROJECT_BINARY_DIR} --target all_verify_interface_header_sets)
mpc_add_project_test(project.unit_tests_under_sanitizers
  ${CMAKE_CTEST_COMMAND} --test-dir ${PROJECT_SOURCE_DIR}/build/asan -L unit --no-tests=error
    --parallel ${cores})

if(TARGET mpc::mpc)
  mpc_add_project_test(project.install
    ${CMAKE_COMMAND} --install ${PROJECT_BINARY_DIR} --prefix ${prefix})
  set_tests_properties(project.install PROPERTIES FIXTURES_SETUP installed)
  mpc_add_project_test(project.install_consumer
    ${CMAKE_CTEST_COMMAND} --build-and-test ${CMAKE_CURRENT_LIST_DIR}/install_consumer
      ${PROJECT_BINARY_DIR}/install_consumer --build-generator ${CMAKE_GENERATOR}
      --build-options -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_BUILD_TYPE=Release
      --test-command consumer)
  set_tests_properties(project.install_consumer PROPERTIES FIXTURES_REQUIRED installed)
  # The same warnings and compiler launcher as here let a compiler cache serve it.
  mpc_add_project_test(project.subdirectory_consumer
    ${CMAKE_CTEST_COMMAND} --build-and-test ${CMAKE_CURRENT_LIST_DIR}/subdirectory_consumer
      ${PROJECT_BINARY_DIR}/subdirectory_consumer --build-generator ${CMAKE_GENERATOR}
      --build-target consumer
      --build-options -DMPC_SOURCE_DIR=${PROJECT_SOURCE_DIR} -DCMAKE_BUILD_TYPE=Release
      -DMPC_WERROR=${MPC_WERROR} -DCMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER}
      --test-command consumer)
endif()
