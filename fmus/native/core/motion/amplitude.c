#include "motion/amplitude.h"

#include <math.h>

#include "motion/magnitude.h"

/* Limits of the first-order amplitude law: least frequency, relative to `natural`, and most added damping ratio. */
static const double LEAST_FREQUENCY = 0.1, MOST_ADDED_RATIO = 1.0;

bool vi_amplitude_acts(const vi_amplitude_law *law)
{
    return law->frequency_slope != 0.0 || law->damping_slope != 0.0 || law->damping_reciprocal != 0.0;
}

double vi_amplitude_of(double displacement, double velocity, double natural)
{
    return vi_magnitude(displacement, velocity / natural);
}

double vi_amplitude_natural(const vi_amplitude_law *law, double natural, double amplitude)
{
    return natural * fmax(LEAST_FREQUENCY, 1.0 + law->frequency_slope * amplitude);
}

double vi_amplitude_ratio(const vi_amplitude_law *law, double ratio, double amplitude)
{
    double added = law->damping_slope * amplitude;
    if (law->damping_reciprocal != 0.0) {
        added += amplitude > 0.0 ? law->damping_reciprocal / amplitude : MOST_ADDED_RATIO;
    }
    return fmax(0.0, ratio + fmin(added, MOST_ADDED_RATIO));
}
