# raybench_verdict: verdicts, aimed rays, truth in integers, the oracle without CGAL.
# raybench_oracle: the exact oracle. CGAL is linked privately: its target forces -frounding-math on whoever links it.
# Truth on disk is good for these sources only.
file(GLOB truth_sources CONFIGURE_DEPENDS approx.h box_tree.* exact_truth.* oracle* surd.* verdict.*)
list(APPEND truth_sources ${PROJECT_SOURCE_DIR}/accel/exact.h)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${truth_sources})
set(RAYBENCH_TRUTH_SOURCES "")
foreach(source ${truth_sources})
  file(SHA256 ${source} hash)
  string(APPEND RAYBENCH_TRUTH_SOURCES ${hash})
endforeach()
string(SHA256 RAYBENCH_TRUTH_SOURCES "${RAYBENCH_TRUTH_SOURCES}")

find_package(Boost CONFIG REQUIRED)  # headers: integers of any length
add_library(raybench_verdict STATIC
  aimed.cpp box_tree.cpp exact_truth.cpp margins.cpp mesh_edges.cpp oracle_boxes.cpp surd.cpp verdict.cpp)
target_link_libraries(raybench_verdict PUBLIC raybench_tracer Boost::headers PRIVATE raybench_flags TBB::tbb)
# GCC 14, and GCC 12 for some processors, suspect Boost's integers.
target_compile_options(raybench_verdict PRIVATE
  "$<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-maybe-uninitialized;-Wno-stringop-overflow>")

if(RAYBENCH_WITH_CGAL)
  add_library(raybench_oracle STATIC oracle_audit.cpp oracle_cgal.cpp)
  target_link_libraries(raybench_oracle PRIVATE raybench_verdict raybench_flags CGAL::CGAL fmt::fmt)
  # With sanitizers GCC 12 suspects CGAL's own templates.
  target_compile_options(raybench_oracle PRIVATE -Wno-maybe-uninitialized)
  target_link_libraries(raybench_verdict PRIVATE raybench_oracle)
  target_compile_definitions(raybench_verdict PRIVATE RAYBENCH_HAS_CGAL)
endif()
