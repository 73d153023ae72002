# The loop around the controller, its transport, and the executable.
target_sources(
  quasilpv_controller
  PRIVATE src/crc32.cpp
          src/csv_writer.cpp
          src/failsafe.cpp
          src/in_process_link.cpp
          src/lcm_link.cpp
          src/link.cpp
          src/loop.cpp
          src/messages.cpp
          src/realtime.cpp
          src/run_controller.cpp
          src/run_report.cpp
          src/safe_torque.cpp
          src/telemetry_publisher.cpp)
target_link_libraries(quasilpv_controller PUBLIC quasilpv_lcmtypes Threads::Threads PRIVATE lcm::lcm)

add_executable(qlpv-controller app/qlpv_controller.cpp)
target_link_libraries(qlpv-controller PRIVATE quasilpv_controller CLI11::CLI11)
quasilpv_target(qlpv-controller)

if(SKBUILD)
  install(TARGETS qlpv-controller DESTINATION ${SKBUILD_SCRIPTS_DIR})
else()
  install(TARGETS qlpv-controller DESTINATION bin)
endif()
