/* Modes of an Euler-Bernoulli beam, in forms that keep all digits up to high orders. equations.md 6.1 to 6.8
 *
 * Shapes have unit mean square over the length: int_0^1 phi_i phi_j ds = delta_ij. Here s = x / length, from the first
 * of the two ends in the boundary's name. Modes are counted from j = 1.
 */
#ifndef VIBROIMPACT_BEAM_MODES_H
#define VIBROIMPACT_BEAM_MODES_H

/* Support of the two ends; the numbers are those of the enumeration BeamBoundary. */
typedef enum {
    VI_CLAMPED_FREE = 1,
    VI_CLAMPED_CLAMPED = 2,
    VI_CLAMPED_PINNED = 3,
    VI_PINNED_PINNED = 4
} vi_beam_boundary;

/* Eigenvalue xi_j, to one rounding: natural angular frequency = xi^2 sqrt(E I / (mass_per_length length^4)). */
double vi_beam_eigenvalue(vi_beam_boundary boundary, int j);

/* phi_j(s), or its derivative of order 0 to 3 over s, 0 <= s <= 1. The first antinode from s = 0 is positive. Values
 * that the ends prescribe are exact (0; tip of the clamped-free beam 2 (-1)^(j+1)). Elsewhere the error is some 1e-15
 * xi^derivative, for every j. */
double vi_beam_shape(vi_beam_boundary boundary, int j, double s, int derivative);

/* int_0^1 phi_j ds: participation of mode j in a uniform load or in an acceleration of the base. */
double vi_beam_participation(vi_beam_boundary boundary, int j);

/* Estimated relative error of a natural frequency in Euler-Bernoulli's theory (equations.md 6.7): Timoshenko's drop of
 * the frequency, to leading order. It holds for the pinned-pinned beam and about as well for the others. slenderness =
 * radius of gyration / length; E / G and the shear coefficient (5/6 for a rectangle) as in 6.7. */
double vi_beam_validity(vi_beam_boundary boundary, int j, double slenderness, double e_over_g,
                        double shear_coefficient);

/* Modal velocities d_c of modes 1 to n after a unit impulse at grid point `at` (0-based) of n points s[], by
 * collocation: phi . d_c = 1 at this point and 0 at the others, the thesis's rule (7.60). Returns 0, with direction
 * unchanged, when the grid is singular (a point twice, a point on a support) or n is not within 1 to VI_MODES. */
int vi_beam_collocation(vi_beam_boundary boundary, int n, const double s[], int at, double direction[]);

#endif
