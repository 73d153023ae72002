# cmake -DPROGRAM=... -DARCHIVE=... -P needs_nothing.cmake: the core asks for no symbol of LCM, libsodium or the wire.
execute_process(COMMAND readelf --dynamic --wide ${PROGRAM} OUTPUT_VARIABLE needed COMMAND_ERROR_IS_FATAL ANY)
if(needed MATCHES "NEEDED[^\n]*(liblcm|libsodium|libglib)[^\n]*")
  message(FATAL_ERROR "${PROGRAM} needs ${CMAKE_MATCH_1}")
endif()
execute_process(COMMAND nm --undefined-only ${ARCHIVE} OUTPUT_VARIABLE undefined COMMAND_ERROR_IS_FATAL ANY)
if(undefined MATCHES "(lcm_|crypto_|sodium_|telemetry_v|measurement_v|command_v)[^\n]*")
  message(FATAL_ERROR "${ARCHIVE} asks for ${CMAKE_MATCH_0}")
endif()
