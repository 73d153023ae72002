# What find_package(quasilpv) reads, besides the targets that quasilpv_library exports. A minor version may break:
# before 1.0, Semantic Versioning promises nothing more.
include(CMakePackageConfigHelpers)
set(quasilpv_components core link controller sim)
if(QUASILPV_CORE_ONLY)
  set(quasilpv_components core)
endif()
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/quasilpv)
configure_package_config_file(cmake/quasilpvConfig.cmake.in quasilpvConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(quasilpvConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/quasilpvConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/quasilpvConfigVersion.cmake
              cmake/FindLCM.cmake cmake/FindSodium.cmake
        DESTINATION ${package_dir} COMPONENT development)
install(EXPORT quasilpvTargets NAMESPACE quasilpv:: DESTINATION ${package_dir} COMPONENT development)
