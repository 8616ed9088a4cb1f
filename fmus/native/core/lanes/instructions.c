#include "lanes/instructions.h"

#include <stdbool.h>
#include <stddef.h>

#if defined(__x86_64__)
static bool has(int set)
{
    __builtin_cpu_init();
    return set == VI_INSTRUCTIONS_AVX512 ? __builtin_cpu_supports("avx512f") != 0
                                         : set != VI_INSTRUCTIONS_AVX2 || __builtin_cpu_supports("avx2") != 0;
}

static vi_lanes_rounds compiled(int set)
{
    return set == VI_INSTRUCTIONS_AVX512 ? vi_lanes_rounds_avx512
           : set == VI_INSTRUCTIONS_AVX2 ? vi_lanes_rounds_avx2
                                         : vi_lanes_rounds_baseline;
}
#else
/* Other machines have only their baseline (NEON on arm64). */
static bool has(int set)
{
    return set == VI_INSTRUCTIONS_BASELINE;
}

static vi_lanes_rounds compiled(int set)
{
    (void)set;
    return vi_lanes_rounds_baseline;
}
#endif

int vi_lanes_instructions(int set)
{
    if (set < VI_INSTRUCTIONS_BEST || set > VI_INSTRUCTIONS_AVX512) {
        return 0;
    }
    if (set != VI_INSTRUCTIONS_BEST) {
        return has(set) ? set : 0;
    }
    int best = VI_INSTRUCTIONS_AVX512;
    while (!has(best)) {
        best -= 1;
    }
    return best;
}

vi_lanes_rounds vi_lanes_rounds_of(int set)
{
    const int found = vi_lanes_instructions(set);
    return found == 0 ? NULL : compiled(found);
}
