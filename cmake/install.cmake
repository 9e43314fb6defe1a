# cmake --install: the program with its manual page and completion, and the libraries for find_package(Ambilux).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

add_library(ambilux_library INTERFACE)
target_link_libraries(ambilux_library INTERFACE ambilux_stress ambilux_convert)
set_target_properties(ambilux_library PROPERTIES EXPORT_NAME library)

set(libraries ambilux_options ambilux_core ambilux_models ambilux_scene ambilux_transport ambilux_accel ambilux_images
  ambilux_formats ambilux_convert ambilux_items ambilux_queues ambilux_stages ambilux_film ambilux_integrators ambilux_backends
  ambilux_render ambilux_session ambilux_experiments ambilux_stress ambilux_library)
install(TARGETS ${libraries} EXPORT AmbiluxTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/ambilux
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/ambilux)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/Ambilux)
install(EXPORT AmbiluxTargets NAMESPACE Ambilux:: DESTINATION ${package})
configure_package_config_file(cmake/AmbiluxConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/AmbiluxConfig.cmake
  INSTALL_DESTINATION ${package})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/AmbiluxConfigVersion.cmake COMPATIBILITY ExactVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/AmbiluxConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/AmbiluxConfigVersion.cmake
  DESTINATION ${package})
install(DIRECTORY core models scene transport accel formats items queues film stages integrators backends render
  session experiments stress DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/ambilux FILES_MATCHING PATTERN "*.h")

install(TARGETS ambilux)
foreach(kind man completion)
  add_custom_command(OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/ambilux.${kind} COMMAND ambilux help ${kind}
    > ${CMAKE_CURRENT_BINARY_DIR}/ambilux.${kind} DEPENDS ambilux VERBATIM)
endforeach()
add_custom_target(ambilux_manual ALL
  DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/ambilux.man ${CMAKE_CURRENT_BINARY_DIR}/ambilux.completion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/ambilux.man DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 RENAME ambilux.1)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/ambilux.completion
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME ambilux)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
