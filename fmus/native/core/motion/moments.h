/* Response of one mode at rest to a force that is a Legendre polynomial of the time, in closed form.
 *
 * The integral of e^(lambda (length - s)) P_n(s) over 0 <= s <= length is length (-1)^n e^z i_n(z). Here z is
 * lambda length / 2, and i_n the modified spherical Bessel function. No digits are lost for fast or slow modes.
 */
#ifndef VIBROIMPACT_MOMENTS_H
#define VIBROIMPACT_MOMENTS_H

#include <stdbool.h>

#include "motion/flow.h"
#include "motion/legendre.h"

/* Is there a closed form? There is none near critical damping and above it. */
bool vi_moments_exist(const vi_mode *mode);

/* Displacement and velocity of the mode after `length` seconds from rest, under the force per unit mass P_n(s), for
 * n = 0 to VI_NODES - 1. */
void vi_moments(const vi_mode *mode, double length, double displacement[VI_NODES], double velocity[VI_NODES]);

#endif
