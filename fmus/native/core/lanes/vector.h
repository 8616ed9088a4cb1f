/* Vectors of VI_WIDTH numbers and their elementwise operations. A lane's bits do not depend on the width.
 *
 * Included by the files that define VI_WIDTH, one for each instruction set. GNU vector extensions: gcc, clang and zig
 * have them on every machine.
 */
#ifndef VIBROIMPACT_LANE_VECTOR_H
#define VIBROIMPACT_LANE_VECTOR_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

typedef double vector __attribute__((vector_size(8 * VI_WIDTH), may_alias));
typedef int64_t mask __attribute__((vector_size(8 * VI_WIDTH), may_alias));

/* All functions of a round are inlined into one, except under a sanitizer: its checks take minutes to compile. */
#if defined(__SANITIZE_ADDRESS__)
#define LANES_INLINE static inline
#else
#define LANES_INLINE static inline __attribute__((always_inline))
#endif

/* Tables are read again after this. A compiler that read them all before a loop would only write them to its stack. */
#define READ_HERE() __asm__ volatile("" ::: "memory")

/* A function of its own: it has a small frame, and compilers do better on small functions. */
#define LANES_APART static __attribute__((noinline)) void

LANES_INLINE vector load(const double *from)
{
    return *(const vector *)from;
}

LANES_INLINE void store(double *to, vector value)
{
    *(vector *)to = value;
}

LANES_INLINE vector all(double value)
{
    return value - (vector){0.0};
}

LANES_INLINE vector choose(mask where, vector a, vector b)
{
    return (vector)(((mask)a & where) | ((mask)b & ~where));
}

/* `a` where the mask is set, otherwise 0. */
LANES_INLINE vector only(mask where, vector a)
{
    return (vector)((mask)a & where);
}

/* larger and smaller return b where one is NaN and where both are 0. any: is a lane of the mask set? */
#if defined(__x86_64__) && VI_WIDTH == 8
LANES_INLINE vector larger(vector a, vector b)
{
    return (vector)_mm512_max_pd((__m512d)a, (__m512d)b);
}

LANES_INLINE vector smaller(vector a, vector b)
{
    return (vector)_mm512_min_pd((__m512d)a, (__m512d)b);
}

LANES_INLINE bool any(mask where)
{
    return _mm512_test_epi64_mask((__m512i)where, (__m512i)where) != 0;
}
#else
LANES_INLINE vector larger(vector a, vector b)
{
    return choose(a > b, a, b);
}

LANES_INLINE vector smaller(vector a, vector b)
{
    return choose(a < b, a, b);
}

LANES_INLINE bool any(mask where)
{
#if VI_WIDTH == 4 /* halves of a register are joined before numbers are */
    typedef int64_t pair __attribute__((vector_size(16)));
    const union {
        mask whole;
        pair half[2];
    } parts = {where};
    const pair found = parts.half[0] | parts.half[1];
    return (found[0] | found[1]) != 0;
#else
    int64_t found = 0;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        found |= where[i];
    }
    return found != 0;
#endif
}
#endif

LANES_INLINE vector size_of(vector a)
{
    return (vector)((mask)a & INT64_MAX);
}

LANES_INLINE vector root(vector a)
{
    vector r;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        r[i] = sqrt(a[i]);
    }
    return r;
}

/* Rounding error of the sum `sum` = a + b (Knuth). */
LANES_INLINE vector error_of_sum(vector a, vector b, vector sum)
{
    const vector part = sum - a;
    return (a - (sum - part)) + (b - part);
}

/* Adding this to a number below 2^51 leaves the nearest whole number in the low bits. */
#define WHOLE 6755399441055744.0

/* Largest whole number <= a, for 0 <= a < 2^51. */
LANES_INLINE vector whole_part(vector a)
{
    const vector near = (a + WHOLE) - WHOLE;
    return near - only(near > a, all(1.0));
}

/* Cosine and sine of an angle r beyond a number of quarter turns, for |r| <= pi/4 (the polynomials are fdlibm's). */
LANES_INLINE void turn_beyond(mask count, vector r, vector *cosine, vector *sine)
{
    const vector z = r * r, half = 0.5 * z, w = z * z;
    const vector odd = (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03)
                       + w * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
                              + w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10));
    const vector even = (4.16666666666666019037e-02 + z * -1.38888888888741095749e-03)
                        + w * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07)
                               + w * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    const vector s = r + (r * z) * odd, one = 1.0 - half;
    const vector c = one + (((1.0 - one) - half) + w * even);
    const mask swapped = -(count & 1);
    *sine = (vector)((mask)choose(swapped, c, s) ^ ((count & 2) << 62));
    *cosine = (vector)((mask)choose(swapped, s, c) ^ (((count + 1) & 2) << 62));
}

/* Cosine and sine of 0 <= angle <= 8, to 1 ulp. */
LANES_INLINE void turn(vector angle, vector *cosine, vector *sine)
{
    const vector shifted = angle * 0.63661977236758134308 + WHOLE;
    const vector quarters = shifted - WHOLE;
    const vector r = (angle - quarters * 1.57079632673412561417) - quarters * 6.07710050650619224932e-11;
    turn_beyond((mask)shifted, r, cosine, sine);
}

/* Cosine and sine of a number of turns below 2^48. */
LANES_INLINE void turn_by(vector turns, vector *cosine, vector *sine)
{
    const vector shifted = 4.0 * turns + WHOLE;
    const vector r = (turns - 0.25 * (shifted - WHOLE)) * 6.283185307179586232;
    turn_beyond((mask)shifted, r, cosine, sine);
}

#endif
