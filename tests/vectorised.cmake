# Fails unless GCC reports that the loops of SOURCE became SIMD code of 64, 32 and 16 bytes (AVX-512, AVX2, SSE2). A scalar
# loop would give the same values, ten times slower, and nothing else would notice. LOOPS: how many lines of files that
# match FILES such loops start on; 1 in the batches of models if not given.
if(NOT DEFINED LOOPS)
  set(LOOPS 1)
  set(FILES "evaluate/make_float_model\\.h")
endif()
execute_process(
  COMMAND ${COMPILER} -std=c++20 -O3 -ffp-contract=off -fno-math-errno -fno-trapping-math -I${INCLUDE}
          -DLOBEFIT_VERSION="" -fopt-info-vec-optimized -c ${SOURCE} -o /dev/null
  ERROR_VARIABLE report
  RESULT_VARIABLE status)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "${SOURCE} does not compile:\n${report}")
endif()
foreach(bytes 64 32 16)
  string(REGEX MATCHALL "${FILES}:[0-9]+:[0-9]+: optimized: loop vectorized using ${bytes} byte vectors" loops "${report}")
  list(TRANSFORM loops REPLACE ":[0-9]+: optimized.*" "")
  list(REMOVE_DUPLICATES loops)
  list(LENGTH loops count)
  if(count LESS LOOPS)
    message(FATAL_ERROR "${SOURCE}: ${count} of ${LOOPS} loops are vectorised with ${bytes}-byte vectors:\n${report}")
  endif()
endforeach()
