/* The lockstep for AVX512. */
#include "lanes/instructions.h"

#if defined(__x86_64__)
#include <immintrin.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx512f"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx512f")
#endif
#define VI_WIDTH 8
#define VI_ROUNDS vi_lanes_rounds_avx512
#include "lanes/rounds_many.h"
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif
