#include "contact/complementarity.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Pivot, relative to the largest diagonal, below which contacts count as redundant. */
static const double REDUNDANT = 1e-13;
/* Compliance added to each redundant contact, relative to the largest mobility: redundant contacts then share their
 * load. REFINEMENTS is the number of solutions; each solves for the residual of the last. */
static const double SOFTENING = 1e-6;
enum { REFINEMENTS = 4 };
/* Most turns of the pivoting: those of its proof, 2^contacts, up to eight contacts; more contacts take a few each. */
enum { MOST_TURNS = VI_PORTS <= 8 ? 1 << VI_PORTS : 32 * VI_PORTS };
/* Turns for each contact within which each gap is resolved to its own rounding, if it can be. */
enum { FINE_TURNS = 4 };
/* Rounding of a gap, relative to its terms or to the largest load. */
static const double GAP_ROUNDING = 8.0 * DBL_EPSILON;

/* Gaussian elimination with partial pivoting; 0 when a pivot is too small. */
static int eliminate(int n, double a[VI_PORTS][VI_PORTS + 1], double smallest)
{
    for (int column = 0; column < n; ++column) {
        int pivot = column;
        for (int row = column + 1; row < n; ++row) {
            pivot = fabs(a[row][column]) > fabs(a[pivot][column]) ? row : pivot;
        }
        if (!(fabs(a[pivot][column]) > smallest)) {
            return 0;
        }
        for (int k = column; k <= n; ++k) {
            const double moved = a[column][k];
            a[column][k] = a[pivot][k];
            a[pivot][k] = moved;
        }
        for (int row = 0; row < n; ++row) {
            const double factor = row == column ? 0.0 : a[row][column] / a[column][column];
            for (int k = column; k <= n && factor != 0.0; ++k) {
                a[row][k] -= factor * a[column][k];
            }
        }
    }
    return 1;
}

/* Solve for the contacts in `index`, with this softening and right-hand side b; 0 when the contacts are redundant. */
static int solve(int count, double g[VI_PORTS][VI_PORTS], const int index[], const double b[], double softening,
                 double smallest, double p[])
{
    double a[VI_PORTS][VI_PORTS + 1];
    for (int i = 0; i < count; ++i) {
        for (int j = 0; j < count; ++j) {
            a[i][j] = g[index[i]][index[j]] + (i == j ? softening : 0.0);
        }
        a[i][count] = b[i];
    }
    if (!eliminate(count, a, smallest)) {
        return 0;
    }
    for (int i = 0; i < count; ++i) {
        p[i] = a[i][count] / a[i][i];
    }
    return 1;
}

/* Solve for redundant contacts: softened, then repeatedly for the residual that the softening leaves. */
static void share(int count, double g[VI_PORTS][VI_PORTS], const int index[], const double b[], double largest,
                  double p[])
{
    double left[VI_PORTS], more[VI_PORTS] = {0.0};
    for (int i = 0; i < count; ++i) {
        p[i] = 0.0;
    }
    for (int turn = 0; turn < REFINEMENTS; ++turn) {
        for (int i = 0; i < count; ++i) {
            left[i] = b[i];
            for (int j = 0; j < count; ++j) {
                left[i] -= g[index[i]][index[j]] * p[j];
            }
        }
        if (!solve(count, g, index, left, SOFTENING * largest, 0.0, more)) {
            return;
        }
        for (int i = 0; i < count; ++i) {
            p[i] += more[i];
        }
    }
}

void vi_solve_active(int n, double g[VI_PORTS][VI_PORTS], const double b[VI_PORTS], const int active[VI_PORTS],
                     double p[VI_PORTS])
{
    int index[VI_PORTS], count = 0;
    double largest = 0.0, load[VI_PORTS], found[VI_PORTS];
    for (int k = 0; k < n; ++k) {
        p[k] = 0.0;
        if (active[k]) {
            load[count] = b[k];
            index[count++] = k;
            largest = fmax(largest, fabs(g[k][k]));
        }
    }
    if (count == 0 || !(largest > 0.0)) {
        return;
    }
    if (!solve(count, g, index, load, 0.0, REDUNDANT * largest, found)) {
        share(count, g, index, load, largest, found);
    }
    for (int i = 0; i < count; ++i) {
        p[index[i]] = found[i];
    }
}

/* Murty's principal pivoting: the first contact that pulls, or is passed through, changes sides. It is finite for
 * positive definite g, with the proof's bound on the turns. A gap is 0 within the rounding of its own terms, or
 * with `load` > 0 of the largest load. Returns 0 at the bound: redundant contacts may cycle. */
static int pivot_to_answer(int n, double g[VI_PORTS][VI_PORTS], const double b[VI_PORTS], double load, int turns,
                           int active[VI_PORTS], double p[VI_PORTS])
{
    for (int k = 0; k < n; ++k) {
        active[k] = b[k] > 0.0;
    }
    for (int turn = 0; turn < turns; ++turn) {
        vi_solve_active(n, g, b, active, p);
        int wrong = -1;
        for (int k = 0; k < n && wrong < 0; ++k) {
            double gap = -b[k], size = fabs(b[k]);
            for (int l = 0; l < n; ++l) {
                gap += g[k][l] * p[l];
                size += fabs(g[k][l] * p[l]);
            }
            if (active[k] ? p[k] < 0.0 : gap < -GAP_ROUNDING * (load > 0.0 ? load : size)) {
                wrong = k;
            }
        }
        if (wrong < 0) {
            return 1;
        }
        active[wrong] = !active[wrong];
    }
    return 0;
}

void vi_complementary(int n, double g[VI_PORTS][VI_PORTS], const double b[VI_PORTS], double p[VI_PORTS])
{
    int active[VI_PORTS];
    double load = 0.0;
    for (int k = 0; k < n; ++k) {
        load = fmax(load, fabs(b[k]));
    }
    if (!pivot_to_answer(n, g, b, 0.0, FINE_TURNS * n, active, p)
        && !pivot_to_answer(n, g, b, load, MOST_TURNS, active, p)) {
        /* soften all contacts, so that every set of contacts has one answer; then solve again for the residual */
        double soft[VI_PORTS][VI_PORTS], found[VI_PORTS], largest = 0.0, least = 0.0;
        for (int k = 0; k < n; ++k) {
            largest = fmax(largest, fabs(g[k][k]));
        }
        memcpy(soft, g, sizeof soft);
        for (int k = 0; k < n; ++k) {
            soft[k][k] += SOFTENING * largest;
        }
        pivot_to_answer(n, soft, b, load, MOST_TURNS, active, p);
        vi_solve_active(n, g, b, active, found);
        for (int k = 0; k < n; ++k) {
            least = fmin(least, found[k]);
        }
        if (least >= 0.0) {
            memcpy(p, found, sizeof found);
        }
    }
    for (int k = 0; k < n; ++k) {
        p[k] = fmax(0.0, p[k]);
    }
}
