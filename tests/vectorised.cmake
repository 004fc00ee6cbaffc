# Fails unless GCC reports that the batch loop of SOURCE became SIMD code of 64, 32 and 16 bytes (AVX-512, AVX2, SSE2).
# A scalar loop would give the same values, ten times slower, and nothing else would notice.
execute_process(
  COMMAND ${COMPILER} -std=c++20 -O3 -ffp-contract=off -fno-math-errno -fno-trapping-math -I${INCLUDE}
          -DLOBEFIT_VERSION="" -fopt-info-vec-optimized -c ${SOURCE} -o /dev/null
  ERROR_VARIABLE report
  RESULT_VARIABLE status)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "${SOURCE} does not compile:\n${report}")
endif()
foreach(bytes 64 32 16)
  if(NOT report MATCHES "float_model/[A-Za-z0-9]+\\.cpp:[0-9:]+ optimized: loop vectorized using ${bytes} byte vectors")
    message(FATAL_ERROR "${SOURCE}: the batch loop is not vectorised with ${bytes}-byte vectors:\n${report}")
  endif()
endforeach()
