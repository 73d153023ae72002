# One place for the compile options of every target of the project.
#
# Warnings are errors. -ffast-math is never used: it makes isfinite(NaN) true. -ffp-contract=off keeps the
# arithmetic of the step the same on machines with and without fused multiply-add, so that runs are
# bit-reproducible.
function(quasilpv_target target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
                                           -Wnon-virtual-dtor -Wold-style-cast -Werror -ffp-contract=off)
endfunction()
