#include "modes/beam_residual.h"

#include <math.h>

#include "modes/singular.h"

/* Last mode in the sums for B: TAIL_FACTOR N + TAIL_LEAST. Terms of B fall as xi^-8, and the omitted terms are below
 * 1e-6 of B. TOO_NEAR: least pivot of A, relative to its diagonal entry; below, two points count as the same. */
enum { TAIL_FACTOR = 8, TAIL_LEAST = 56 };
static const double TOO_NEAR = 1e-7;

static double clamped_free_static(double s, double c)
{
    return s <= c ? s * s * (3.0 * c - s) / 6.0 : c * c * (3.0 * s - c) / 6.0;
}

double vi_beam_static_shape(vi_beam_boundary boundary, double s, double c)
{
    const double near = s <= c ? s : c, far = s <= c ? c : s, rest = 1.0 - far;
    switch (boundary) {
    case VI_CLAMPED_FREE:
        return clamped_free_static(s, c);
    case VI_CLAMPED_CLAMPED:
        return rest * rest * near * near * (3.0 * far - (1.0 + 2.0 * far) * near) / 6.0;
    case VI_CLAMPED_PINNED: /* 3 far (2 - far) - near (2 + 2 far - far^2), over 12 */
        return rest * near * near * (3.0 * far * (2.0 - far) - near * (2.0 + 2.0 * far - far * far)) / 12.0;
    default:
        return rest * near * (far * (2.0 - far) - near * near) / 6.0;
    }
}

/* Displacement at s under a uniform load of 1. */
static double evenly_loaded(vi_beam_boundary boundary, double s)
{
    const double rest = 1.0 - s;
    switch (boundary) {
    case VI_CLAMPED_FREE:
        return s * s * (6.0 - 4.0 * s + s * s) / 24.0;
    case VI_CLAMPED_CLAMPED:
        return s * s * rest * rest / 24.0;
    case VI_CLAMPED_PINNED:
        return s * s * rest * (3.0 - 2.0 * s) / 48.0;
    default:
        return s * rest * (1.0 + s - s * s) / 24.0;
    }
}

static double fourth_power(double x)
{
    return x * x * x * x;
}

static double eigenvalue_4(vi_beam_boundary boundary, int j)
{
    return fourth_power(vi_beam_eigenvalue(boundary, j));
}

/* psi_k at s: the static shape without the kept modes. */
static double dropped_static(const vi_beam_residual *r, double s, int k)
{
    double kept = 0.0;
    for (int j = r->natural; j >= 1; --j) {
        kept += vi_beam_shape(r->boundary, j, s, 0) * vi_beam_shape(r->boundary, j, r->point[k], 0)
                / eigenvalue_4(r->boundary, j);
    }
    return vi_beam_static_shape(r->boundary, s, r->point[k]) - kept;
}

/* The matrix B, summed from the smallest terms. */
static void dropped_mass(const vi_beam_residual *r, double b[VI_PORTS][VI_PORTS])
{
    for (int n = TAIL_FACTOR * r->natural + TAIL_LEAST; n > r->natural; --n) {
        double shape[VI_PORTS];
        const double scale = 1.0 / eigenvalue_4(r->boundary, n);
        for (int k = 0; k < r->points; ++k) {
            shape[k] = scale * vi_beam_shape(r->boundary, n, r->point[k], 0);
        }
        for (int k = 0; k < r->points; ++k) {
            for (int l = 0; l <= k; ++l) {
                b[k][l] += shape[k] * shape[l];
                b[l][k] = b[k][l];
            }
        }
    }
}

/* Factor A = L L' in place: the lower triangle becomes L. Returns 0, or the number of a dependent row. */
static int factor(int n, double a[VI_PORTS][VI_PORTS])
{
    for (int k = 0; k < n; ++k) {
        const double whole = a[k][k];
        for (int l = 0; l <= k; ++l) {
            for (int i = 0; i < l; ++i) {
                a[k][l] -= a[k][i] * a[l][i];
            }
            if (l < k) {
                a[k][l] /= a[l][l];
            }
        }
        if (!(a[k][k] > TOO_NEAR * whole)) {
            return k + 1;
        }
        a[k][k] = sqrt(a[k][k]);
    }
    return 0;
}

/* The matrix L^-1 B L^-T. */
static void reduce(int n, double lower[VI_PORTS][VI_PORTS], double b[VI_PORTS][VI_PORTS],
                   double reduced[VI_PORTS][VI_MODES])
{
    for (int column = 0; column < n; ++column) { /* L^-1 B, column by column */
        for (int k = 0; k < n; ++k) {
            for (int i = 0; i < k; ++i) {
                b[k][column] -= lower[k][i] * b[i][column];
            }
            b[k][column] /= lower[k][k];
        }
    }
    for (int row = 0; row < n; ++row) { /* its rows times L^-T */
        for (int k = 0; k < n; ++k) {
            reduced[row][k] = b[row][k];
            for (int i = 0; i < k; ++i) {
                reduced[row][k] -= lower[k][i] * reduced[row][i];
            }
            reduced[row][k] /= lower[k][k];
        }
    }
}

int vi_beam_residual_find(vi_beam_residual *residual, vi_beam_boundary boundary, int natural, int points,
                          const double point[])
{
    double a[VI_PORTS][VI_PORTS], b[VI_PORTS][VI_PORTS] = {{0.0}}, reduced[VI_PORTS][VI_MODES];
    vi_singular singular;
    *residual = (vi_beam_residual){.boundary = boundary, .natural = natural, .points = points};
    for (int k = 0; k < points; ++k) {
        residual->point[k] = point[k];
    }
    for (int k = 0; k < points; ++k) {
        for (int l = 0; l <= k; ++l) {
            a[k][l] = dropped_static(residual, point[k], l);
        }
    }
    dropped_mass(residual, b);
    const int explained = factor(points, a);
    if (explained != 0) {
        return explained;
    }
    reduce(points, a, b, reduced);
    if (!vi_singular_find(points, points, reduced, &singular) || singular.rank < points) {
        return points;
    }
    for (int i = 0; i < points; ++i) { /* the largest value belongs to the lowest frequency */
        const int from = points - 1 - i;
        residual->eigenvalue[i] = pow(singular.value[from], -0.25);
        for (int k = points - 1; k >= 0; --k) { /* L^-T y */
            double share = singular.right[from][k];
            for (int l = k + 1; l < points; ++l) {
                share -= a[l][k] * residual->weight[i][l];
            }
            residual->weight[i][k] = share / a[k][k];
        }
    }
    for (int i = 0; i < points; ++i) { /* normalise: v'B v = 1 */
        const double scale = residual->eigenvalue[i] * residual->eigenvalue[i];
        for (int k = 0; k < points; ++k) {
            residual->weight[i][k] *= scale;
        }
    }
    return 0;
}

double vi_beam_residual_shape(const vi_beam_residual *residual, int i, double s)
{
    double shape = 0.0;
    for (int k = 0; k < residual->points; ++k) {
        shape += residual->weight[i][k] * dropped_static(residual, s, k);
    }
    return shape;
}

double vi_beam_residual_participation(const vi_beam_residual *residual, int i)
{
    double participation = 0.0;
    for (int k = 0; k < residual->points; ++k) {
        double dropped = evenly_loaded(residual->boundary, residual->point[k]);
        for (int j = residual->natural; j >= 1; --j) {
            dropped -= vi_beam_participation(residual->boundary, j)
                       * vi_beam_shape(residual->boundary, j, residual->point[k], 0)
                       / eigenvalue_4(residual->boundary, j);
        }
        participation += residual->weight[i][k] * dropped;
    }
    return participation;
}
