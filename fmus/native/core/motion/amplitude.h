/* Natural frequency and damping ratio as functions of the amplitude: the equivalent linear mode of a weakly nonlinear
 * one (averaging, Krylov and Bogoliubov). Both are found at the start of a step and held over the step. So a step
 * should be short against the time in which the amplitude changes.
 *
 * With amplitude a:  frequency = natural (1 + frequency_slope a),
 *                    damping ratio = ratio + damping_slope a + damping_reciprocal / a.
 * Quadratic damping, m x'' + b |x'| x', is damping_slope = 4 b / (3 pi m). Dry friction of force f is
 * damping_reciprocal = 2 f / (pi m natural^2).
 */
#ifndef VIBROIMPACT_AMPLITUDE_H
#define VIBROIMPACT_AMPLITUDE_H

#include <stdbool.h>

typedef struct {
    double frequency_slope;    /* 1/m */
    double damping_slope;      /* 1/m */
    double damping_reciprocal; /* m */
} vi_amplitude_law;

/* Does the law change the frequency or the damping at any amplitude? */
bool vi_amplitude_acts(const vi_amplitude_law *law);

/* sqrt(x^2 + (v / natural)^2) */
double vi_amplitude_of(double displacement, double velocity, double natural);

/* Natural angular frequency at an amplitude, rad/s; at least a tenth of `natural`, where the law has left its range. */
double vi_amplitude_natural(const vi_amplitude_law *law, double natural, double amplitude);

/* Damping ratio at an amplitude, at least 0. The law adds at most 1, which stops dry motion within a period. */
double vi_amplitude_ratio(const vi_amplitude_law *law, double ratio, double amplitude);

#endif
