# One place for the compile options of every target of the project, and for where it is installed.
#
# Installed components: `python` is what the wheel takes, `runtime` the executables, `development` what
# find_package(quasilpv) needs (cmake/quasilpvConfig.cmake.in).
include(GNUInstallDirs)

# Warnings are errors. -ffast-math is never used: it makes isfinite(NaN) true. -ffp-contract=off keeps the
# arithmetic of the step the same on machines with and without fused multiply-add, so that runs are
# bit-reproducible.
function(quasilpv_target target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
                                           -Wnon-virtual-dtor -Wold-style-cast -Werror -ffp-contract=off)
endfunction()

# An executable of the project, linked with one of its libraries.
function(quasilpv_executable name source library)
  add_executable(${name} ${source})
  target_link_libraries(${name} PRIVATE ${library} quasilpv_command_line)
  quasilpv_target(${name})
  set_target_properties(${name} PROPERTIES INSTALL_RPATH "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
  install(TARGETS ${name} DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
  if(SKBUILD)
    install(TARGETS ${name} DESTINATION ${SKBUILD_SCRIPTS_DIR} COMPONENT python)
  endif()
endfunction()

# A target of the project is quasilpv::<name> here and for those who find_package(quasilpv).
function(quasilpv_export target name)
  add_library(quasilpv::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  install(TARGETS ${target} EXPORT quasilpvTargets DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
endfunction()

# A library of the project; `headers` is the folder of its public ones, relative to the CMakeLists.txt.
function(quasilpv_library target name headers)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/${headers}>
                                              $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES VERSION ${PROJECT_VERSION}
                                             SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  quasilpv_target(${target})
  quasilpv_export(${target} ${name})
  install(DIRECTORY ${headers}/quasilpv DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
endfunction()
