# The plant's side of a run over a link, and the executable.
target_sources(quasilpv_sim PRIVATE src/plant_loop.cpp)

add_executable(qlpv-simulator app/qlpv_simulator.cpp)
target_link_libraries(qlpv-simulator PRIVATE quasilpv_sim CLI11::CLI11)
quasilpv_target(qlpv-simulator)

if(SKBUILD)
  install(TARGETS qlpv-simulator DESTINATION ${SKBUILD_SCRIPTS_DIR})
else()
  install(TARGETS qlpv-simulator DESTINATION bin)
endif()
