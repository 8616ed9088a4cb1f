/* Residual vectors of a beam: shapes of the omitted modes under forces at given points.
 *
 * A beam of N modes is too stiff at a stop, by the compliance of the omitted modes. The shapes
 *
 *     psi_k(s) = sum_(n > N) phi_n(s) phi_n(s_k) / xi_n^4
 *
 * are orthogonal to the N modes. The small eigenvalue problem A v = xi^4 B v makes them orthogonal to each other. Here
 * A_kl = sum phi_n(s_k) phi_n(s_l) / xi_n^4 and B_kl = sum phi_n(s_k) phi_n(s_l) / xi_n^8. This is a Ritz basis, with
 * natural frequencies above that of mode N. The beam then yields to static forces at the points as with all its modes:
 * the residual compliance of equations.md 6.6, with a mass.
 */
#ifndef VIBROIMPACT_BEAM_RESIDUAL_H
#define VIBROIMPACT_BEAM_RESIDUAL_H

#include "modes/beam_modes.h"
#include "sizes.h"

/* Natural frequencies ascend; every shape has unit mean square over the length. */
typedef struct {
    vi_beam_boundary boundary;
    int natural, points;              /* kept modes; points, with one vector each */
    double point[VI_PORTS];           /* s_k */
    double weight[VI_PORTS][VI_PORTS]; /* weight[i][k]: share of psi_k in vector i */
    double eigenvalue[VI_PORTS];      /* xi: natural angular frequency = xi^2 sqrt(E I / (mass_per_length length^4)) */
} vi_beam_residual;

/* Find the vectors for `points` different points 0 < s <= 1, none on a support, beside the first `natural` modes.
 * Returns 0, or the number (from 1) of a point that is not distinguishable from an earlier one (some 1e-4 /
 * natural). */
int vi_beam_residual_find(vi_beam_residual *residual, vi_beam_boundary boundary, int natural, int points,
                          const double point[]);

/* Residual vector i (from 0) at s. */
double vi_beam_residual_shape(const vi_beam_residual *residual, int i, double s);

/* int_0^1 of residual vector i over s. */
double vi_beam_residual_participation(const vi_beam_residual *residual, int i);

/* Displacement at s under a force at c of a beam with all modes, E I = 1 and length = 1. */
double vi_beam_static_shape(vi_beam_boundary boundary, double s, double c);

#endif
