#include "modes/chain_modes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "modes/singular.h"

static const double PI = 3.14159265358979323846;
static const double TAKES_PART = 1e-8; /* displacement times sqrt(mass) above which a mass sets a mode's sign */
/* C M^-1 K - K M^-1 C, relative to its terms' moduli, up to which C and K commute; each term has a few roundings. */
static const double COMMUTES = 32.0 * DBL_EPSILON;
/* Off-diagonal modal damping, relative to the diagonal, up to which modes count as uncoupled. If C and K commute, modes
 * of equal frequencies are not unique: the modes found need not be those that the damping separates. */
static const double DIAGONAL = 1e-9;

/* Elongation of element e in mode j for q_j = 1, kg^(-1/2). Across a stiff spring between masses that move far
 * together, the difference of the shapes has no digits left, so elongations are kept apart. */
typedef struct {
    double in[VI_MODES + 1][VI_MODES];
} elongations;

static bool in_range(const vi_chain *chain)
{
    if (chain->masses < 1 || chain->masses > VI_MODES) {
        return false;
    }
    for (int e = 0; e <= chain->masses; ++e) {
        const double mass = e < chain->masses ? chain->mass[e] : 1.0;
        if (!(mass > 0.0) || !(chain->stiffness[e] >= 0.0) || !(chain->damping[e] >= 0.0)
            || !isfinite(mass + chain->stiffness[e] + chain->damping[e])) {
            return false;
        }
    }
    return true;
}

static bool is_uniform(const vi_chain *chain)
{
    bool same = chain->stiffness[0] > 0.0 && chain->stiffness[chain->masses] == 0.0;
    for (int i = 1; i < chain->masses; ++i) {
        same = same && chain->mass[i] == chain->mass[0] && chain->stiffness[i] == chain->stiffness[0];
    }
    return same;
}

/* sin(pi number / (2 of)), with the angle reduced without rounding. */
static double sine_of_quarter(int number, int of)
{
    number %= 4 * of;
    const double sign = number > 2 * of ? -1.0 : 1.0;
    number %= 2 * of;
    number = number > of ? 2 * of - number : number;
    return sign * (2 * number > of ? cos(PI * (of - number) / (2.0 * of)) : sin(PI * number / (2.0 * of)));
}

/* Modes in closed form: equations.md 5.2. */
static void find_uniform(const vi_chain *chain, vi_chain_modes *modes, elongations *elongation)
{
    const int n = chain->masses, of = 2 * n + 1;
    const double size = 2.0 / sqrt((double)of * chain->mass[0]);
    const double scale = 2.0 * sqrt(chain->stiffness[0] / chain->mass[0]);
    for (int j = 0; j < n; ++j) {
        const double half = sine_of_quarter(2 * j + 1, of);
        modes->natural[j] = scale * half;
        for (int i = 0; i < n; ++i) {
            modes->shape[i][j] = size * sine_of_quarter(2 * (2 * j + 1) * (i + 1), of);
            elongation->in[i][j] = 2.0 * size * half * sine_of_quarter((2 * j + 1) * (2 * i + 1) + of, of);
        }
        elongation->in[n][j] = -modes->shape[n - 1][j];
    }
}

/* Find the rigid-body modes: each group of masses tied to each other but not to the ground moves as one. They fill
 * columns from 0 on. Returns their number. */
static int find_rigid(const vi_chain *chain, vi_chain_modes *modes)
{
    const int n = chain->masses;
    int found = 0;
    for (int first = 0, end; first < n; first = end) {
        double mass = chain->mass[first];
        for (end = first + 1; end < n && chain->stiffness[end] > 0.0; ++end) {
            mass += chain->mass[end];
        }
        if (chain->stiffness[first] > 0.0 || (end == n && chain->stiffness[n] > 0.0)) {
            continue;
        }
        for (int i = 0; i < n; ++i) {
            modes->shape[i][found] = i >= first && i < end ? 1.0 / sqrt(mass) : 0.0;
        }
        ++found;
    }
    return found;
}

/* Take the displacement at the other end of an element plus the elongation, if this has a smaller error. */
static void improve(double *here, double *error, double there, double there_error, double elongation, double blur)
{
    if (there_error + blur < *error) {
        *here = there + elongation;
        *error = there_error + blur;
    }
}

/* Find the displacements of the masses in mode j. A small mass among large ones has few digits as a component of a unit
 * vector times 1 / sqrt(mass). In modes slower than this mass on its own springs, its neighbours give more digits. */
static void place_masses(const vi_chain *chain, int j, vi_chain_modes *modes, const elongations *elongation)
{
    const int n = chain->masses;
    double error[VI_MODES + 2], at[VI_MODES + 2]; /* of the ground, the masses, the ground */
    double blur[VI_MODES + 1];
    at[0] = at[n + 1] = error[0] = error[n + 1] = 0.0;
    for (int i = 0; i < n; ++i) {
        at[i + 1] = modes->shape[i][j];
        error[i + 1] = 1.0 / sqrt(chain->mass[i]);
    }
    for (int e = 0; e <= n; ++e) {
        blur[e] = chain->stiffness[e] > 0.0 ? modes->natural[j] / sqrt(chain->stiffness[e]) : HUGE_VAL;
    }
    for (int i = 1; i <= n; ++i) {
        improve(&at[i], &error[i], at[i - 1], error[i - 1], elongation->in[i - 1][j], blur[i - 1]);
    }
    for (int i = n; i >= 1; --i) {
        improve(&at[i], &error[i], at[i + 1], error[i + 1], -elongation->in[i][j], blur[i]);
    }
    for (int i = 0; i < n; ++i) {
        modes->shape[i][j] = at[i + 1];
    }
}

/* Fill B, one row for each spring: its force, in units of sqrt(stiffness), for a displacement of 1 / sqrt(mass). */
static void fill_factor(const vi_chain *chain, double factor[][VI_MODES])
{
    const int n = chain->masses;
    for (int e = 0; e <= n; ++e) {
        memset(factor[e], 0, (size_t)n * sizeof factor[e][0]);
        if (e > 0) {
            factor[e][e - 1] = -sqrt(chain->stiffness[e] / chain->mass[e - 1]);
        }
        if (e < n) {
            factor[e][e] = sqrt(chain->stiffness[e] / chain->mass[e]);
        }
    }
}

static bool find_general(const vi_chain *chain, vi_chain_modes *modes, elongations *elongation)
{
    const int n = chain->masses;
    double factor[VI_MODES + 1][VI_MODES];
    vi_singular singular;
    fill_factor(chain, factor);
    const int rigid = find_rigid(chain, modes);
    if (!vi_singular_find(n + 1, n, factor, &singular) || singular.rank + rigid != n) {
        return false;
    }
    for (int j = rigid; j < n; ++j) {
        const int k = j - rigid;
        modes->natural[j] = singular.value[k];
        for (int e = 0; e <= n; ++e) {
            const double stiffness = chain->stiffness[e];
            elongation->in[e][j] = stiffness > 0.0 ? singular.value[k] * singular.left[k][e] / sqrt(stiffness) : 0.0;
        }
        for (int i = 0; i < n; ++i) {
            modes->shape[i][j] = singular.right[k][i] / sqrt(chain->mass[i]);
        }
        place_masses(chain, j, modes, elongation);
    }
    return true;
}

/* Find elongations between masses without a spring, from the differences of their shapes. */
static void elongate_gaps(const vi_chain *chain, const vi_chain_modes *modes, elongations *elongation)
{
    const int n = chain->masses;
    for (int e = 0; e <= n; ++e) {
        for (int j = 0; j < n && chain->stiffness[e] == 0.0; ++j) {
            elongation->in[e][j] = (e < n ? modes->shape[e][j] : 0.0) - (e > 0 ? modes->shape[e - 1][j] : 0.0);
        }
    }
}

static void orient(const vi_chain *chain, vi_chain_modes *modes, elongations *elongation)
{
    const int n = chain->masses;
    for (int j = 0; j < n; ++j) {
        int first = 0;
        while (first < n - 1 && sqrt(chain->mass[first]) * fabs(modes->shape[first][j]) <= TAKES_PART) {
            ++first;
        }
        const double sign = modes->shape[first][j] < 0.0 ? -1.0 : 1.0;
        for (int i = 0; i < n; ++i) {
            modes->shape[i][j] *= sign;
        }
        for (int e = 0; e <= n; ++e) {
            elongation->in[e][j] *= sign;
        }
    }
}

/* Modal damping matrix Psi' C Psi, summed over the dampers. */
static void project_damping(const vi_chain *chain, vi_chain_modes *modes, const elongations *elongation)
{
    const int n = chain->masses;
    for (int e = 0; e <= n; ++e) {
        const double *g = elongation->in[e];
        for (int i = 0; i < n && chain->damping[e] > 0.0; ++i) {
            for (int j = 0; j < n; ++j) {
                modes->damping[i][j] += chain->damping[e] * g[i] * g[j];
            }
        }
    }
    for (int j = 0; j < n; ++j) {
        modes->damping_ratio[j] = modes->natural[j] > 0.0 ? modes->damping[j][j] / (2.0 * modes->natural[j]) : 0.0;
    }
}

/* Entry (i, j) of the chain's matrix of element values; j is i - 1, i or i + 1. */
static double entry(const double element[], int i, int j)
{
    return i == j ? element[i] + element[i + 1] : -element[i > j ? i : j];
}

/* Is entry (i, j) of C M^-1 K - K M^-1 C mere rounding? */
static bool commutes_at(const vi_chain *chain, int i, int j)
{
    double difference = 0.0, size = 0.0;
    for (int through = 0; through < chain->masses; ++through) {
        if (abs(through - i) <= 1 && abs(through - j) <= 1) {
            const double one = entry(chain->damping, i, through) * entry(chain->stiffness, through, j);
            const double other = entry(chain->stiffness, i, through) * entry(chain->damping, through, j);
            difference += (one - other) / chain->mass[through];
            size += (fabs(one) + fabs(other)) / chain->mass[through];
        }
    }
    return fabs(difference) <= COMMUTES * size;
}

static bool commutes(const vi_chain *chain)
{
    for (int i = 0; i < chain->masses; ++i) {
        for (int j = i + 1; j < chain->masses && j <= i + 2; ++j) { /* further apart, and for i = j, the entry is 0 */
            if (!commutes_at(chain, i, j)) {
                return false;
            }
        }
    }
    return true;
}

/* Does the damping keep the modes found apart, each with a ratio? */
static bool is_diagonal(int n, const vi_chain_modes *modes)
{
    for (int i = 0; i < n; ++i) {
        if (modes->natural[i] == 0.0 && modes->damping[i][i] != 0.0) {
            return false;
        }
        for (int j = 0; j < i; ++j) {
            if (fabs(modes->damping[i][j]) > DIAGONAL * (modes->damping[i][i] + modes->damping[j][j])) {
                return false;
            }
        }
    }
    return true;
}

bool vi_chain_find_modes(const vi_chain *chain, vi_chain_modes *modes)
{
    if (!in_range(chain)) {
        return false;
    }
    elongations elongation;
    memset(modes, 0, sizeof *modes);
    memset(&elongation, 0, sizeof elongation);
    if (is_uniform(chain)) {
        find_uniform(chain, modes, &elongation);
    } else if (!find_general(chain, modes, &elongation)) {
        return false;
    }
    elongate_gaps(chain, modes, &elongation);
    orient(chain, modes, &elongation);
    project_damping(chain, modes, &elongation);
    modes->classical = commutes(chain) && is_diagonal(chain->masses, modes);
    return true;
}
