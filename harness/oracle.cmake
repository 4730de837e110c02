# raybench_verdict: verdicts, aimed rays, truth in integers, the oracle without CGAL.
# raybench_oracle: the exact oracle. CGAL is linked privately: its target forces -frounding-math on whoever links it.
# Truth on disk is good for these sources only: what truth is made by, all headers of ours that these include,
# and what stands behind the headers. A file that truth comes to depend on is so among them by itself.
file(GLOB truth_sources CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} oracle*.cpp)
list(APPEND truth_sources harness/exact_truth.cpp harness/verdict.cpp)
set(unread ${truth_sources})
while(unread)
  list(POP_FRONT unread source)
  file(STRINGS ${PROJECT_SOURCE_DIR}/${source} includes REGEX "^#include \"")
  foreach(include IN LISTS includes)
    string(REGEX REPLACE "^#include \"([^\"]*)\".*" "\\1" header "${include}")
    string(REGEX REPLACE "\\.h$" ".cpp" behind "${header}")
    foreach(file IN ITEMS ${header} ${behind})
      if(EXISTS ${PROJECT_SOURCE_DIR}/${file} AND NOT file IN_LIST truth_sources)
        list(APPEND truth_sources ${file})
        list(APPEND unread ${file})
      endif()
    endforeach()
  endforeach()
endwhile()
list(SORT truth_sources)
list(JOIN truth_sources "\n" truth_listing)
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/truth_sources.txt "${truth_listing}\n")
list(TRANSFORM truth_sources PREPEND ${PROJECT_SOURCE_DIR}/)
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
