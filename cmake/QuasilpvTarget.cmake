# One place for the compile options of every target of the project.
#
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
  target_link_libraries(${name} PRIVATE ${library} CLI11::CLI11)
  quasilpv_target(${name})
  if(SKBUILD)
    install(TARGETS ${name} DESTINATION ${SKBUILD_SCRIPTS_DIR})
  else()
    install(TARGETS ${name} DESTINATION bin)
  endif()
endfunction()
