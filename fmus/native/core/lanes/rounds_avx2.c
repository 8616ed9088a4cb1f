/* The lockstep for AVX2. */
#include "lanes/instructions.h"

#if defined(__x86_64__)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#define VI_WIDTH 4
#define VI_ROUNDS vi_lanes_rounds_avx2
#include "lanes/rounds_many.h"
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif
