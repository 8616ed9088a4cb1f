#include "modes/growth.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "motion/majorant.h"

/* Rounding of a damping matrix, as a part of its size; times the number of modes. */
static const double MATRIX_ROUNDING = 64.0 * DBL_EPSILON;

static double size_of(int modes, const double coupling[][VI_MODES])
{
    double size = 0.0;
    for (int i = 0; i < modes; ++i) {
        for (int j = 0; j < modes; ++j) {
            size = vi_max(size, fabs(coupling[i][j]));
        }
    }
    return size;
}

/* Does the damping matrix take energy from each motion, within rounding? Cholesky's factor of the matrix with a little
 * more on its diagonal exists. */
static bool never_gains(int modes, const double coupling[][VI_MODES], double slack)
{
    double factor[VI_MODES][VI_MODES];
    for (int i = 0; i < modes; ++i) {
        for (int j = 0; j <= i; ++j) {
            double left = coupling[i][j] + (i == j ? slack : 0.0);
            for (int k = 0; k < j; ++k) {
                left -= factor[i][k] * factor[j][k];
            }
            if (i == j && !(left > 0.0)) {
                return false;
            }
            factor[i][j] = i == j ? sqrt(left) : left / factor[j][j];
        }
    }
    return true;
}

double vi_growth_of(int modes, const vi_mode mode[], const double coupling[][VI_MODES])
{
    const double size = coupling != NULL ? size_of(modes, coupling) : 0.0;
    double growth = 0.0;
    for (int j = 0; j < modes; ++j) {
        const double by_spring = mode[j].stiffness < 0.0 ? mode[j].natural : 0.0;
        growth = vi_max(growth, coupling != NULL ? by_spring : mode[j].growth);
    }
    const bool gains = size > 0.0 && !never_gains(modes, coupling, MATRIX_ROUNDING * size * (double)modes);
    return gains ? growth + (double)modes * size : growth;
}
