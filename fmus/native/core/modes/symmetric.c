#include "modes/symmetric.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "motion/rows.h"

/* Size of an entry, relative to the roots of its two diagonal entries, up to which it is 0: a few roundings. */
static const double NEGLIGIBLE = 8.0 * DBL_EPSILON;
/* Least size of 1 + tangent^2 of a rotation; below, the plane has only one vector, to half the digits. */
static const double DEFECTIVE = 1e-8;
enum { MOST_SWEEPS = 40 }; /* ten are usual */

typedef struct {
    vi_complex cosine, sine;
} rotation;

/* The square root with a positive real part. */
static vi_complex root(vi_complex a)
{
    const double size = sqrt(vi_complex_size(a)), half = 0.5 * atan2(a.im, a.re);
    return (vi_complex){size * cos(half), size * sin(half)};
}

/* The smaller of the two angles that turn the plane of i and j to its vectors; false where no angle exists. */
static bool find_rotation(vi_complex first, vi_complex second, vi_complex off, rotation *turn)
{
    const vi_complex one = {1.0, 0.0};
    const vi_complex cotangent = vi_complex_divide(vi_complex_subtract(second, first), vi_complex_scale(2.0, off));
    const vi_complex rest = root(vi_complex_add(one, vi_complex_multiply(cotangent, cotangent)));
    const vi_complex plus = vi_complex_add(cotangent, rest), minus = vi_complex_subtract(cotangent, rest);
    const bool larger = vi_complex_square(plus) >= vi_complex_square(minus);
    const vi_complex tangent = vi_complex_invert(larger ? plus : minus);
    const vi_complex scale = vi_complex_add(one, vi_complex_multiply(tangent, tangent));
    if (!(vi_complex_size(scale) > DEFECTIVE)) {
        return false;
    }
    turn->cosine = vi_complex_invert(root(scale));
    turn->sine = vi_complex_multiply(tangent, turn->cosine);
    return true;
}

/* The product, with the bits of vi_complex_multiply: both parts at once. */
static inline vi_pair multiply(vi_complex a, vi_pair b)
{
    return (vi_pair){a.re, a.re} * b + (vi_pair){-a.im, a.im} * (vi_pair){b[1], b[0]};
}

static inline void rotate_one(const rotation *turn, vi_complex *x, vi_complex *y)
{
    vi_pair *const first = (vi_pair *)x, *const second = (vi_pair *)y;
    const vi_pair kept = *first, other = *second;
    *first = multiply(turn->cosine, kept) - multiply(turn->sine, other);
    *second = multiply(turn->sine, kept) + multiply(turn->cosine, other);
}

/* Rotate the entries beside those of i and j, above the diagonal: only these are read. */
static void rotate_matrix(int n, const rotation *turn, vi_complex a[][VI_STATES], int i, int j)
{
    for (int k = 0; k < i; ++k) {
        rotate_one(turn, &a[k][i], &a[k][j]);
    }
    for (int k = i + 1; k < j; ++k) {
        rotate_one(turn, &a[i][k], &a[k][j]);
    }
    for (int k = j + 1; k < n; ++k) {
        rotate_one(turn, &a[i][k], &a[j][k]);
    }
}

/* Make entry (i, j) of the matrix 0. */
static bool annihilate(int n, vi_complex a[][VI_STATES], vi_complex vector[][VI_STATES], int i, int j)
{
    rotation turn;
    const vi_complex off = a[i][j];
    if (!find_rotation(a[i][i], a[j][j], off, &turn)) {
        return false;
    }
    const vi_complex moved = vi_complex_multiply(vi_complex_divide(turn.sine, turn.cosine), off);
    const vi_complex first = vi_complex_subtract(a[i][i], moved), second = vi_complex_add(a[j][j], moved);
    rotate_matrix(n, &turn, a, i, j);
    a[i][i] = first;
    a[j][j] = second;
    a[i][j] = (vi_complex){0.0, 0.0};
    for (int k = 0; k < n; ++k) {
        rotate_one(&turn, &vector[i][k], &vector[j][k]);
    }
    return true;
}

static bool is_negligible(vi_complex first, vi_complex second, vi_complex off)
{
    return !(vi_complex_size(off) > NEGLIGIBLE * sqrt(vi_complex_size(first)) * sqrt(vi_complex_size(second)));
}

bool vi_symmetric_find(int n, vi_complex a[][VI_STATES], vi_complex vector[][VI_STATES])
{
    for (int k = 0; k < n; ++k) {
        memset(vector[k], 0, (size_t)n * sizeof vector[k][0]);
        vector[k][k].re = 1.0;
    }
    for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
        bool moved = false;
        for (int i = 0; i < n; ++i) {
            for (int j = i + 1; j < n; ++j) {
                if (is_negligible(a[i][i], a[j][j], a[i][j])) {
                    continue;
                }
                moved = true;
                if (!annihilate(n, a, vector, i, j)) {
                    return false;
                }
            }
        }
        if (!moved) {
            return true;
        }
    }
    return false;
}
