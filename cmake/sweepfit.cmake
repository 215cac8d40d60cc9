# One helper per kind of target.

function(sweepfit_target_options target)
  target_include_directories(${target} PUBLIC ${sweepfit_SOURCE_DIR})
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow
    -Wno-deprecated-enum-enum-conversion)
  if(SWEEPFIT_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  target_compile_definitions(${target} PRIVATE
    $<$<CONFIG:Debug>:EIGEN_INITIALIZE_MATRICES_BY_NAN>)
endfunction()

# sweepfit_library(NAME room PUBLIC libs... PRIVATE libs... PCH headers...)
# builds every .cc of the room's folder into sweepfit::room.
function(sweepfit_library)
  cmake_parse_arguments(ARG "" "NAME" "PUBLIC;PRIVATE;PCH" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cc)
  add_library(sweepfit_${ARG_NAME} STATIC ${sources})
  add_library(sweepfit::${ARG_NAME} ALIAS sweepfit_${ARG_NAME})
  sweepfit_target_options(sweepfit_${ARG_NAME})
  target_link_libraries(sweepfit_${ARG_NAME}
    PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  if(ARG_PCH)
    target_precompile_headers(sweepfit_${ARG_NAME} PRIVATE ${ARG_PCH})
  endif()
endfunction()

# sweepfit_test(room) builds tests/<room>/*_test.cc into one program.
function(sweepfit_test room)
  file(GLOB sources CONFIGURE_DEPENDS
    ${CMAKE_CURRENT_SOURCE_DIR}/${room}/*_test.cc)
  if(NOT sources)
    return()
  endif()
  add_executable(${room}_tests ${sources})
  sweepfit_target_options(${room}_tests)
  target_link_libraries(${room}_tests PRIVATE
    sweepfit::test_support sweepfit::${room} ${ARGN})
  gtest_discover_tests(${room}_tests
    TEST_PREFIX "${room}/" DISCOVERY_TIMEOUT 120 PROPERTIES TIMEOUT 600)
endfunction()
